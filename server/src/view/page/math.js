// Vectors as arrays of three numbers, rotations as quaternions [x, y, z, w], and the camera. Everything in double precision: what
// goes to the shaders is seen from the eye.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => times(a, 1 / (length(a) || 1));
export const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

/** The product of two rotations: first b, then a. */
export function turned(a, b) {
    return [
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    ];
}

export const back = (q) => [-q[0], -q[1], -q[2], q[3]];

/** A vector turned by a rotation. */
export function turn(q, v) {
    const u = [q[0], q[1], q[2]];
    const t = times(cross(u, v), 2);
    return add(add(v, times(t, q[3])), cross(u, t));
}

function normalized(q) {
    const n = Math.hypot(...q);
    return q.map((c) => c / n);
}

/** The rotation about v/|v| by the angle |v|. */
export function ofVector(v) {
    const angle = length(v);
    if (angle === 0) return [0, 0, 0, 1];
    const k = Math.sin(angle / 2) / angle;
    return [v[0] * k, v[1] * k, v[2] * k, Math.cos(angle / 2)];
}

/**
 * The pose of a moving frame at t: the position goes straight, the rotation turns about an axis fixed in the world at a constant rate.
 * `m` holds position, rotation, displacement and rotation vector over the step; `place` is a pose within the frame.
 */
export function poseAt(m, place, t) {
    const spin = [m[10] * t, m[11] * t, m[12] * t];
    const start = m.slice(3, 7);
    const rotation = spin[0] === 0 && spin[1] === 0 && spin[2] === 0 ? start : normalized(turned(ofVector(spin), start));
    const position = [m[0] + m[7] * t, m[1] + m[8] * t, m[2] + m[9] * t];
    return {
        position: add(position, turn(rotation, place.slice(0, 3))),
        rotation: turned(rotation, place.slice(3, 7)),
    };
}

/** The rotation whose matrix has these columns. */
function ofAxes(x, y, z) {
    const w = Math.sqrt(Math.max(0, 1 + x[0] + y[1] + z[2])) / 2;
    if (w > 0.1) return [(y[2] - z[1]) / (4 * w), (z[0] - x[2]) / (4 * w), (x[1] - y[0]) / (4 * w), w];
    const a = Math.sqrt(Math.max(0, 1 + x[0] - y[1] - z[2])) / 2;
    if (a > 0.1) return [a, (y[0] + x[1]) / (4 * a), (z[0] + x[2]) / (4 * a), (y[2] - z[1]) / (4 * a)];
    const b = Math.sqrt(Math.max(0, 1 - x[0] + y[1] - z[2])) / 2;
    if (b > 0.1) return [(y[0] + x[1]) / (4 * b), b, (z[1] + y[2]) / (4 * b), (z[0] - x[2]) / (4 * b)];
    const c = Math.sqrt(Math.max(0, 1 - x[0] - y[1] + z[2])) / 2;
    return [(z[0] + x[2]) / (4 * c), (z[1] + y[2]) / (4 * c), c, (x[1] - y[0]) / (4 * c)];
}

/** A perspective camera that goes around a point, z upwards. */
export class Camera {
    constructor() {
        this.target = [0, 0, 0];
        this.distance = 1;
        this.yaw = 0;
        this.pitch = 0.5;
        /** Half the height of the field at distance 1. */
        this.field = Math.tan(Math.PI / 14);
        this.size = [1, 1];
    }

    /** The side that the camera stands on, towards it. */
    look(from) {
        const d = unit(from);
        this.pitch = Math.asin(clamp(d[2], -1, 1));
        if (Math.hypot(d[0], d[1]) > 1e-6) this.yaw = Math.atan2(d[1], d[0]);
    }

    get from() {
        const c = Math.cos(this.pitch);
        return [c * Math.cos(this.yaw), c * Math.sin(this.yaw), Math.sin(this.pitch)];
    }

    get eye() {
        return add(this.target, times(this.from, this.distance));
    }

    /** Unit vectors: right, up, towards the eye. */
    get axes() {
        const z = this.from;
        const x = [-Math.sin(this.yaw), Math.cos(this.yaw), 0];
        return [x, cross(z, x), z];
    }

    /** The rotation from the world to the view: x right, y up, z towards the eye. */
    get rotation() {
        return back(ofAxes(...this.axes));
    }

    /** The view's coordinates in units of pixels at depth 1. */
    get focal() {
        return this.size[1] / 2 / this.field;
    }

    /** The pixel (from the upper left) at which a point of the world is seen, with its distance; none behind the eye. */
    pixel(x) {
        const v = sub(x, this.eye);
        const [right, up, out] = this.axes;
        const depth = -dot(v, out);
        if (depth <= 0) return null;
        const k = this.focal / depth;
        return [this.size[0] / 2 + dot(v, right) * k, this.size[1] / 2 - dot(v, up) * k, length(v)];
    }

    /** The unit direction of the ray through a pixel. */
    ray(px, py) {
        const [right, up, out] = this.axes;
        const u = (px - this.size[0] / 2) / this.focal;
        const v = (this.size[1] / 2 - py) / this.focal;
        return unit(sub(add(times(right, u), times(up, v)), out));
    }

    /** The length in the world that a pixel spans at a point. */
    pixelLength(x) {
        return Math.max(0, -dot(sub(x, this.eye), this.from)) / this.focal;
    }

    /** All of a cloud of points in view, from the side where the camera stands. */
    fit(points) {
        if (!points.length) return;
        const [right, up, out] = this.axes;
        const low = [Infinity, Infinity, Infinity];
        const high = [-Infinity, -Infinity, -Infinity];
        for (const p of points) {
            [right, up, out].forEach((axis, k) => {
                low[k] = Math.min(low[k], dot(p, axis));
                high[k] = Math.max(high[k], dot(p, axis));
            });
        }
        const middle = low.map((l, k) => (l + high[k]) / 2);
        this.target = add(add(times(right, middle[0]), times(up, middle[1])), times(out, middle[2]));
        const aspect = this.size[0] / this.size[1];
        // A margin, for what is written along the sides.
        const field = this.field * 0.96;
        let distance = 1e-9;
        for (const p of points) {
            const v = sub(p, this.target);
            const wide = Math.max(Math.abs(dot(v, right)) / (field * aspect), Math.abs(dot(v, up)) / field);
            distance = Math.max(distance, wide + dot(v, out));
        }
        this.distance = distance;
    }

    orbit(dx, dy) {
        this.yaw -= dx * 0.008;
        this.pitch = clamp(this.pitch + dy * 0.008, -Math.PI / 2, Math.PI / 2);
    }

    pan(dx, dy) {
        const [right, up] = this.axes;
        const k = this.distance / this.focal;
        this.target = add(this.target, add(times(right, -dx * k), times(up, dy * k)));
    }

    /** Closer by a factor, what is below the pixel stays there. */
    zoom(factor, px, py) {
        const [right, up] = this.axes;
        const k = (this.distance / this.focal) * (1 - factor);
        const [x, y] = [px - this.size[0] / 2, this.size[1] / 2 - py];
        this.target = add(this.target, add(times(right, x * k), times(up, y * k)));
        this.distance *= factor;
    }
}
