// The programs. A buffer holds of each pixel what is seen there: object, face, normal and distance; a second pass gives it light.
//
// What stands in `words` and `rows` is told in server/src/view/cells.rs.

/** Numbers of a row of the textures `words` and `rows`. */
export const WIDTH = 2048;

/** Faces that are none of a model: where the section plane cuts, where a triangle has no face, where something endless ends. */
export const CUT = 0xffffffff;
export const NO_FACE = 0xfffffffe;
export const ENDS = 0xfffffffd;
/** A face of triangles, by its id; else by where its rows stand. */
export const BY_ID = 0x40000000;

const VIEW = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform vec2 lens;
uniform vec4 crop;
vec3 turned(vec4 q, vec3 v) {
    vec3 t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}
vec4 placed(vec3 view) {
    float w = -view.z;
    return vec4(view.xy * lens * crop.xy + crop.zw * w, 0.0, w);
}
`;

// What every instance has: the eye in the model's frame, the rotation from the model to the view, its ids.
const INSTANCE = `
layout(location = 1) in vec3 eye;
layout(location = 2) in vec4 rotation;
layout(location = 3) in uvec2 ids;
`;

const PACK = `
uvec4 packed(uint object, uint face, vec3 n, float far) {
    // Octahedral: a unit vector in two numbers.
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 o = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    return uvec4(object + 1u, face, packSnorm2x16(o), floatBitsToUint(far));
}
`;

export const BOX_VERTEX = VIEW + INSTANCE + `
layout(location = 0) in vec3 corner;
layout(location = 4) in vec3 low;
layout(location = 5) in vec3 high;
layout(location = 6) in vec4 cube;
out vec3 way;
flat out vec3 seenFrom;
flat out vec4 seenTurned;
flat out vec3 boxLow;
flat out vec3 boxHigh;
flat out vec4 cubeAt;
flat out uvec2 own;
void main() {
    way = mix(low, high, corner) - eye;
    seenFrom = eye;
    seenTurned = rotation;
    boxLow = low;
    boxHigh = high;
    cubeAt = cube;
    own = ids;
    gl_Position = placed(turned(rotation, way));
}`;

export const BOX_FRAGMENT = VIEW + PACK + `
uniform usampler2D words;
uniform sampler2D rows;
/** The section plane as the view sees it: what is above it is cut away. */
uniform vec4 section;
uniform bool cutting;
/** What a pixel spans at distance 1, and the camera's distance. */
uniform float pixel;
uniform float scale;
in vec3 way;
flat in vec3 seenFrom;
flat in vec4 seenTurned;
flat in vec3 boxLow;
flat in vec3 boxHigh;
flat in vec4 cubeAt;
flat in uvec2 own;
out uvec4 seen;

const uint NEGATED = 1u << 29;

uint word(uint i) { return texelFetch(words, ivec2(int(i & ${WIDTH - 1}u), int(i / ${WIDTH}u)), 0).x; }
vec4 row(uint i) { return texelFetch(rows, ivec2(int(i & ${WIDTH - 1}u), int(i / ${WIDTH}u)), 0); }
float along(vec4 r, vec3 x) { return dot(r.xyz, x) + r.w; }

float psi(uint token, vec3 x) {
    uint form = token >> 26 & 7u;
    uint at = token & 0x3ffffffu;
    vec4 rest = row(at);
    if (form == 0u) return along(rest, x);
    vec3 v = vec3(along(row(at + 1u), x), along(row(at + 2u), x), 0.0);
    if (form == 1u) return length(v) + along(rest, x);
    vec4 third = row(at + 3u);
    v.z = along(third, x);
    if (form == 2u) return length(v) + along(rest, x);
    if (form == 3u) return length(v.xy) - length(vec2(v.z, along(row(at + 4u), x))) + along(rest, x);
    if (form == 4u) return length(vec2(length(v.xy) - rest.x, v.z)) - rest.y;
    return length(vec2(length(v.xy), max(abs(v.z) - rest.x, 0.0))) - rest.y;
}

vec3 gradient(uint token, vec3 x) {
    uint form = token >> 26 & 7u;
    uint at = token & 0x3ffffffu;
    vec4 rest = row(at);
    vec3 g = rest.xyz;
    if (form > 0u) {
        vec4 a = row(at + 1u);
        vec4 b = row(at + 2u);
        vec4 c = form > 1u ? row(at + 3u) : vec4(0.0);
        vec3 v = vec3(along(a, x), along(b, x), along(c, x));
        if (form == 1u) {
            g += (a.xyz * v.x + b.xyz * v.y) / length(v.xy);
        } else if (form == 2u) {
            g += (a.xyz * v.x + b.xyz * v.y + c.xyz * v.z) / length(v);
        } else if (form == 3u) {
            vec4 d = row(at + 4u);
            vec2 n = vec2(v.z, along(d, x));
            g += (a.xyz * v.x + b.xyz * v.y) / length(v.xy) - (c.xyz * n.x + d.xyz * n.y) / max(length(n), 1e-30);
        } else {
            float rho = length(v.xy);
            vec3 out_ = (a.xyz * v.x + b.xyz * v.y) / max(rho, 1e-30);
            vec2 m = form == 4u ? vec2(rho - rest.x, v.z) : vec2(rho, v.z - clamp(v.z, -rest.x, rest.x));
            g = out_ * m.x + c.xyz * m.y;
        }
    }
    g = normalize(g);
    return (token & NEGATED) == 0u ? g : -g;
}

/** f of a cube's list, and the literal that decides it. */
float value(uint list, vec3 x, out uint decides) {
    float waiting[16];
    uint literals[16];
    int high = 0;
    float top = 0.0;
    decides = 0u;
    uint length_ = word(list);
    for (uint i = 1u; i <= length_; i++) {
        uint token = word(list + i);
        uint what = token >> 30;
        if (what == 3u) {
            high--;
            float other = waiting[high];
            if ((token & 1u) == 1u ? other < top : other > top) {
                top = other;
                decides = literals[high];
            }
            continue;
        }
        float v = psi(token, x);
        if ((token & NEGATED) != 0u) v = -v;
        if (what == 0u) {
            if (i > 1u) {
                waiting[high] = top;
                literals[high] = decides;
                high++;
            }
            top = v;
            decides = token;
        } else if (what == 1u ? v > top : v < top) {
            top = v;
            decides = token;
        }
    }
    return top;
}

void main() {
    vec3 d = normalize(way);
    vec3 inView = turned(seenTurned, d);
    vec3 inverse = 1.0 / d;
    vec3 p = (boxLow - seenFrom) * inverse;
    vec3 q = (boxHigh - seenFrom) * inverse;
    vec3 enters = min(p, q);
    float t0 = max(max(enters.x, enters.y), max(enters.z, 0.0));
    vec3 leaves = max(p, q);
    float t1 = min(leaves.x, min(leaves.y, leaves.z));
    bool cut = false;
    if (cutting) {
        float rise = dot(section.xyz, inView);
        float at = section.w / rise;
        if (rise > 0.0) t1 = min(t1, at);
        else if (rise < 0.0 && at > t0) { t0 = at; cut = true; }
        else if (rise == 0.0 && section.w < 0.0) discard;
    }
    if (!(t1 > t0)) discard;

    // From here on positions are seen from where the ray enters: single precision suffices.
    vec3 o = seenFrom + t0 * d;
    float far = t1 - t0;
    float t = 0.0;
    float before = 0.0;
    float edge = 2.0 * cubeAt.w;
    float tiny = 2e-6 * cubeAt.w;
    uint root = own.y;
    uint list = 0u;
    // The list by which the ray was last seen outside, at before; 0: none yet.
    uint outside = 0u;
    float leave = -1.0;
    uint decides = 0u;
    bool hit = false;
    bool full = false;
    bool fresh = true;
    for (int i = 0; i < 700; i++) {
        if (t > far) break;
        vec3 x = o + t * d;
        if (t >= leave) {
            vec3 low = cubeAt.xyz - cubeAt.w;
            float side = edge;
            uint node = root;
            for (int k = 0; k < 14 && (node & 3u) == 2u; k++) {
                side *= 0.5;
                vec3 upper = step(low + side, x);
                low += upper * side;
                node = word((node >> 2) + uint(upper.x + 2.0 * upper.y + 4.0 * upper.z));
            }
            vec3 walls = (low + step(0.0, d) * side - o) * inverse;
            leave = max(min(walls.x, min(walls.y, walls.z)), t) + tiny;
            uint kind = node & 3u;
            if (kind == 0u) { t = leave; fresh = false; outside = 0u; continue; }
            if (kind == 1u) { hit = true; full = true; break; }
            list = node >> 2;
        }
        float f = value(list, x, decides);
        if (f < 0.0) { hit = true; break; }
        fresh = false;
        before = t;
        outside = list;
        t += max(f, 0.25 * pixel * (t0 + t));
        t = min(t, leave);
    }
    if (!hit) discard;

    uint face;
    vec3 n;
    float depth = 0.0;
    if (outside != 0u && outside != list || full) {
        // It came from another cube since. Most often it has passed the surface there already.
        uint which;
        if (outside != 0u && value(outside, o + t * d, which) < 0.0) { list = outside; full = false; }
        else outside = 0u;
    }
    if (outside != 0u) {
        // The sign changed since the last look: halve between.
        float a = before;
        float b = t;
        for (int i = 0; i < 12; i++) {
            float middle = 0.5 * (a + b);
            uint which;
            if (value(list, o + middle * d, which) < 0.0) { b = middle; decides = which; } else a = middle;
        }
        t = b;
    }
    if (!full) depth = -value(list, o + t * d, decides);
    if (cut && fresh) {
        face = ${CUT}u;
        n = normalize(section.xyz);
    } else if (fresh && (full || depth > 4.0 * pixel * t0 + tiny)) {
        // It goes on beyond its box: what is endless is cut off there.
        face = ${ENDS}u;
        vec3 wall = vec3(enters.x >= t0, enters.y >= t0, enters.z >= t0);
        n = turned(seenTurned, normalize(-sign(d) * wall + 1e-9));
    } else {
        // A solid cube behind one with faces: rounding has let the ray pass the last of these by a hair.
        bool lost = full && decides == 0u;
        n = lost ? -inView : turned(seenTurned, gradient(decides, o + t * d));
        face = lost ? ${NO_FACE}u : decides & 0x3ffffffu;
    }
    float way_ = t0 + t;
    gl_FragDepth = way_ / (way_ + scale);
    seen = packed(own.x, face, n, way_);
}`;

export const MESH_VERTEX = VIEW + INSTANCE + `
layout(location = 0) in vec3 corner;
layout(location = 7) in uint id;
out vec3 at;
flat out uvec2 own;
flat out uint face;
void main() {
    at = turned(rotation, corner - eye);
    own = ids;
    face = id;
    gl_Position = placed(at);
}`;

export const MESH_FRAGMENT = VIEW + PACK + `
uniform vec4 section;
uniform bool cutting;
uniform float scale;
in vec3 at;
flat in uvec2 own;
flat in uint face;
out uvec4 seen;
void main() {
    if (cutting && dot(section.xyz, at) > section.w) discard;
    vec3 n = normalize(cross(dFdx(at), dFdy(at)));
    if (dot(n, at) > 0.0) n = -n;
    uint told = face == 0xffffffffu ? ${NO_FACE}u : face | ${BY_ID}u;
    // Where a closed mesh is seen from inside, the plane has cut it.
    if (cutting && !gl_FrontFacing) { told = ${CUT}u; n = normalize(section.xyz); }
    float way = length(at);
    gl_FragDepth = way / (way + scale);
    seen = packed(own.x, told, n, way);
}`;

export const LIGHT_VERTEX = `#version 300 es
void main() {
    vec2 at = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(at, 0.0, 1.0);
}`;

// After server/src/picture/view.rs: a sun over the left shoulder, a sky, edges drawn where object, face or normal change.
export const LIGHT_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform usampler2D buffer_;
uniform sampler2D colors;
/** Samples a pixel along each side. */
uniform int samples;
uniform vec2 lens;
/** The world's z as the view sees it. */
uniform vec3 up;
uniform vec4 section;
uniform float scale;
/** Faces in the foreground: object and face each; of an object alone all faces. */
uniform uvec2 marked[8];
uniform int markedCount;
uniform uvec2 hovered;
uniform vec3 line;
out vec4 color;

struct Seen { uint object; uint face; vec3 n; float far; };

Seen at(ivec2 p) {
    p = clamp(p, ivec2(0), textureSize(buffer_, 0) - 1);
    uvec4 v = texelFetch(buffer_, p, 0);
    vec2 o = unpackSnorm2x16(v.z);
    vec3 n = vec3(o, 1.0 - abs(o.x) - abs(o.y));
    if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    return Seen(v.x, v.y, normalize(n), uintBitsToFloat(v.w));
}

vec3 ray(vec2 p) {
    vec2 ndc = (p + 0.5) / vec2(textureSize(buffer_, 0)) * 2.0 - 1.0;
    return normalize(vec3(ndc / lens, -1.0));
}

float edge(Seen a, Seen b) {
    if (a.object != b.object) return 1.0;
    if (a.object == 0u) return 0.0;
    float bend = dot(a.n, b.n);
    if (a.face != b.face) return bend < 0.985 ? 0.8 : (a.face >= ${ENDS}u || b.face >= ${ENDS}u ? 0.8 : 0.0);
    return bend < 0.6 ? 0.8 : 0.0;
}

/** 0 buried to 1 open: how far what is seen around lies in front of the tangent plane. */
float open(ivec2 p, Seen s, vec3 d) {
    vec3 here = d * s.far;
    float closed = 0.0;
    float reach = 0.045 * scale;
    for (int k = 0; k < 14; k++) {
        float a = 2.4 * float(k);
        float r = sqrt((float(k) + 0.5) / 14.0) * reach / max(s.far, 1e-9) * lens.y * 0.5 * float(textureSize(buffer_, 0).y);
        ivec2 q = p + ivec2(vec2(cos(a), sin(a)) * r);
        Seen other = at(q);
        if (other.object == 0u) continue;
        vec3 off = ray(vec2(q)) * other.far - here;
        float rise = dot(off, s.n);
        float away = length(off);
        closed += clamp(rise / max(away, 1e-9) - 0.08, 0.0, 1.0) * clamp(1.6 - away / reach, 0.0, 1.0);
    }
    return 1.0 - min(closed / 7.0, 0.75);
}

vec4 lit(ivec2 p) {
    Seen s = at(p);
    float stroke = max(edge(s, at(p + ivec2(1, 0))), edge(s, at(p + ivec2(0, 1))));
    if (samples > 1 || stroke == 0.0) {
        stroke = max(stroke, max(edge(s, at(p - ivec2(1, 0))), edge(s, at(p - ivec2(0, 1)))));
    }
    if (s.object == 0u) return vec4(line * stroke, stroke);
    vec3 d = ray(vec2(p));
    vec4 own = texelFetch(colors, ivec2(int((s.object - 1u) & 1023u), int((s.object - 1u) / 1024u)), 0);
    vec3 base = own.rgb;
    if (s.face >= ${ENDS}u && s.face != ${NO_FACE}u) {
        // Hatched, as in a drawing.
        vec3 x = s.face == ${CUT}u ? d * (section.w / dot(section.xyz, d)) : d * s.far;
        float stripe = fract((x.x + x.y) * 64.0 / scale);
        base = stripe < 0.28 ? base * 0.5 : 0.3 + 0.7 * sqrt(base);
    }
    // What is small on the screen is not buried under its edges; own.a is half the size of its box.
    float large = smoothstep(10.0, 70.0, own.a / max(s.far, 1e-9) * lens.y * float(textureSize(buffer_, 0).y) / float(samples));
    stroke *= mix(0.25, 1.0, large);
    vec3 toward = -d;
    vec3 sun = normalize(vec3(-0.55, 0.25, 0.55) + 0.85 * up);
    float direct = max(dot(s.n, sun), 0.0);
    float free = open(p, s, d);
    float sky = 0.42 + 0.18 * dot(s.n, up) + 0.14 * max(dot(s.n, toward), 0.0);
    float shine = direct > 0.0 ? 0.16 * pow(max(dot(s.n, normalize(sun + toward)), 0.0), 40.0) : 0.0;
    float rim = 0.06 * pow(1.0 - max(dot(s.n, toward), 0.0), 3.0);
    vec3 c = base * (0.72 * direct * (0.5 + 0.5 * free) + 0.85 * sky * free) + shine + rim * free;
    c = pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2));
    for (int k = 0; k < markedCount; k++) {
        if (marked[k].x == s.object && (marked[k].y == s.face || marked[k].y == 0u)) {
            c = mix(c, marked[k].y == 0u ? vec3(0.25, 0.62, 1.0) : vec3(1.0, 0.72, 0.12), marked[k].y == 0u ? 0.35 : 0.62);
        }
    }
    if (hovered.x == s.object && hovered.y == s.face) c = mix(c, vec3(1.0), 0.16);
    return vec4(mix(c, line, 0.88 * stroke), 1.0);
}

void main() {
    ivec2 p = ivec2(gl_FragCoord.xy) * samples;
    vec4 sum = vec4(0.0);
    for (int j = 0; j < samples; j++) {
        for (int i = 0; i < samples; i++) sum += lit(p + ivec2(i, j));
    }
    color = sum / float(samples * samples);
}`;
