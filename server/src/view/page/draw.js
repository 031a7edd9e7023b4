// Draws the solids: a buffer of what each pixel sees, made by marching within each object's box, then light. While something moves
// the buffer is as fine as the machine can keep up with; when it rests the whole is drawn again, tile by tile, at full resolution.

import { back, dot, length, sub, turn, turned } from "./math.js";
import * as shaders from "./shaders.js";

/** Numbers of an instance: eye, rotation, object and root, low, high, cube. */
const STRIDE = 19;
/** Milliseconds that a picture may take while something moves. */
const QUICK = 45;
/** Milliseconds that a tile may take. */
const TILE = 60;
/** Milliseconds of rest after which the whole is drawn. */
const REST = 140;
/** The coarsest drawing while something moves, as a part of full resolution along each side. */
const COARSEST = 1 / 12;

function compiled(gl, vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
        program[kind === gl.VERTEX_SHADER ? "first" : "second"] = shader;
    }
    gl.linkProgram(program);
    return program;
}

/** The program's uniforms by name, once it is linked. */
function linked(gl, program) {
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
        const why = [program.first, program.second].map((s) => gl.getShaderInfoLog(s)).join(" ");
        throw new Error(`The graphics driver refuses the page's program: ${gl.getProgramInfoLog(program)} ${why}`);
    }
    const at = {};
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
        const { name } = gl.getActiveUniform(program, i);
        at[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
    }
    return { program, at };
}

/** The corners of the 12 triangles of a box, counter-clockwise from outside. */
function boxCorners() {
    const all = [];
    for (let axis = 0; axis < 3; axis++) {
        for (const side of [0, 1]) {
            const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            const quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) => {
                const c = [0, 0, 0];
                [c[axis], c[u], c[v]] = [side, a, b];
                return c;
            });
            if (side === 0) quad.reverse();
            all.push(quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]);
        }
    }
    return new Float32Array(all.flat());
}

export class Drawing {
    /** `data` holds words, rows and triangles as they came; `models` are the show's. */
    constructor(canvas, models, data) {
        const options = { alpha: true, antialias: false, depth: false, powerPreference: "high-performance" };
        const gl = canvas.getContext("webgl2", options);
        if (!gl) throw new Error("This browser gives no WebGL 2: switch hardware acceleration on, or take another browser.");
        this.gl = gl;
        this.canvas = canvas;
        this.models = models;
        // All three at once: a driver may compile them side by side.
        const programs = [
            compiled(gl, shaders.BOX_VERTEX, shaders.BOX_FRAGMENT),
            compiled(gl, shaders.MESH_VERTEX, shaders.MESH_FRAGMENT),
            compiled(gl, shaders.LIGHT_VERTEX, shaders.LIGHT_FRAGMENT),
        ];
        this.words = this.texture(gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, new Uint32Array(data.words), 1);
        this.rows = this.texture(gl.RGBA32F, gl.RGBA, gl.FLOAT, new Float32Array(data.rows), 4);
        this.corners = this.buffer(boxCorners());
        this.triangles = this.buffer(new Uint8Array(data.triangles));
        this.instances = gl.createBuffer();
        this.colors = gl.createTexture();
        this.boxes = gl.createVertexArray();
        this.light = gl.createVertexArray();
        [this.box, this.mesh, this.shade] = programs.map((p) => linked(gl, p));
        this.part = 0.2;
        this.groups = [];
        this.count = 0;
        this.marked = [];
        this.hovered = [0, 0];
        this.section = null;
        this.line = [0.05, 0.06, 0.08];
        this.waiting = null;
        this.job = null;
        this.changed = 0;
        this.dirty = true;
        this.relit = false;
        this.one = this.target(1, 1);
    }

    texture(inner, format, type, numbers, each) {
        const gl = this.gl;
        const height = Math.max(1, Math.ceil(numbers.length / each / shaders.WIDTH));
        if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
            throw new Error("The models are too large for this graphics driver: view fewer of them.");
        }
        const whole = new numbers.constructor(height * shaders.WIDTH * each);
        whole.set(numbers);
        const texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, inner, shaders.WIDTH, height, 0, format, type, whole);
        this.nearest();
        return texture;
    }

    nearest() {
        const gl = this.gl;
        for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
        for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    }

    buffer(bytes) {
        const gl = this.gl;
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
        return buffer;
    }

    /** A buffer of what is seen, so many pixels large. */
    target(width, height) {
        const gl = this.gl;
        const seen = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, seen);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, width, height);
        this.nearest();
        const depth = gl.createRenderbuffer();
        gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
        gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT32F, width, height);
        const frame = gl.createFramebuffer();
        gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, seen, 0);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
        return { seen, depth, frame, width, height };
    }

    /** An image of colours, so many pixels large. */
    image(width, height) {
        const gl = this.gl;
        const texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
        this.nearest();
        const frame = gl.createFramebuffer();
        gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        return { texture, frame, width, height };
    }

    free(made) {
        const gl = this.gl;
        if (!made) return;
        gl.deleteFramebuffer(made.frame);
        gl.deleteTexture(made.seen ?? made.texture);
        if (made.depth) gl.deleteRenderbuffer(made.depth);
    }

    /** The objects from now on: their models, and linear colours. */
    objects(objects, colors) {
        const gl = this.gl;
        // Those that are marched through first, then one group for each model of triangles.
        const order = objects.map((o, i) => [o.model, i]);
        const isMesh = (m) => this.models[m].triangles[1] > 0;
        const shown = order.filter(([m]) => isMesh(m) || this.models[m].faces.length);
        shown.sort((a, b) => isMesh(a[0]) - isMesh(b[0]) || a[0] - b[0] || a[1] - b[1]);
        this.order = shown.map(([, i]) => i);
        this.count = shown.filter(([m]) => !isMesh(m)).length;
        this.groups = [];
        shown.forEach(([m], at) => {
            if (!isMesh(m)) return;
            const last = this.groups.at(-1);
            if (last?.model === m) last.count += 1;
            else this.groups.push({ model: m, from: at, count: 1, triangles: this.models[m].triangles });
        });
        this.numbers = new Float32Array(shown.length * STRIDE);
        const whole = new Uint32Array(this.numbers.buffer);
        shown.forEach(([m, i], at) => {
            const model = this.models[m];
            whole.set([i, model.root], at * STRIDE + 7);
            this.numbers.set([...model.low, ...model.high, ...model.cube], at * STRIDE + 9);
        });
        gl.bindVertexArray(this.boxes);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
        this.instanced(0, true);
        for (const group of this.groups) {
            group.array = gl.createVertexArray();
            gl.bindVertexArray(group.array);
            gl.bindBuffer(gl.ARRAY_BUFFER, this.triangles);
            gl.enableVertexAttribArray(0);
            gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 16, 0);
            gl.enableVertexAttribArray(7);
            gl.vertexAttribIPointer(7, 1, gl.UNSIGNED_INT, 16, 12);
            this.instanced(group.from, false);
        }
        gl.bindVertexArray(null);
        const height = Math.max(1, Math.ceil(objects.length / 1024));
        const texels = new Float32Array(1024 * height * 4);
        colors.forEach((c, i) => {
            const { low, high } = this.models[objects[i].model];
            texels.set([...c, length(sub(high, low)) / 2], i * 4);
        });
        gl.bindTexture(gl.TEXTURE_2D, this.colors);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 1024, height, 0, gl.RGBA, gl.FLOAT, texels);
        this.nearest();
        this.change();
    }

    /** Where the numbers of instances stand, from the one numbered `from` on. */
    instanced(from, boxes) {
        const gl = this.gl;
        gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
        const own = [[1, 3, 0], [2, 4, 3], [4, 3, 9], [5, 3, 12], [6, 4, 15]].slice(0, boxes ? 5 : 2);
        const start = from * STRIDE;
        for (const [at, size, offset] of own) {
            gl.enableVertexAttribArray(at);
            gl.vertexAttribPointer(at, size, gl.FLOAT, false, STRIDE * 4, (start + offset) * 4);
            gl.vertexAttribDivisor(at, 1);
        }
        gl.enableVertexAttribArray(3);
        gl.vertexAttribIPointer(3, 2, gl.UNSIGNED_INT, STRIDE * 4, (start + 7) * 4);
        gl.vertexAttribDivisor(3, 1);
    }

    /** What is to be seen has changed. */
    change() {
        this.dirty = true;
        this.changed = performance.now();
        this.job = null;
    }

    /** Only its light has. */
    relight() {
        this.relit = true;
    }

    /** Poses of all objects, and where they are seen from. */
    place(poses, camera) {
        const gl = this.gl;
        const [view, eye] = [camera.rotation, camera.eye];
        this.order.forEach((i, at) => {
            const { position, rotation } = poses[i];
            const seen = turn(back(rotation), sub(eye, position));
            this.numbers.set([...seen, ...turned(view, rotation)], at * STRIDE);
        });
        gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
        gl.bufferData(gl.ARRAY_BUFFER, this.numbers, gl.DYNAMIC_DRAW);
        this.camera = camera;
        this.lens = [(camera.size[1] / camera.size[0]) / camera.field, 1 / camera.field];
        this.up = turn(view, [0, 0, 1]);
        // The plane n·x = d of the world as the view sees it.
        const s = this.section;
        this.plane = s ? [...turn(view, s.normal), s.offset - dot(s.normal, eye)] : [0, 0, 1, 0];
    }

    /** Fills a buffer, or a rectangle of it. */
    march(target, crop, pixel, rectangle) {
        const gl = this.gl;
        gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
        gl.viewport(0, 0, target.width, target.height);
        gl.enable(gl.DEPTH_TEST);
        gl.depthFunc(gl.LESS);
        gl.disable(gl.BLEND);
        if (rectangle) {
            gl.enable(gl.SCISSOR_TEST);
            gl.scissor(...rectangle);
        }
        gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
        gl.clearBufferfv(gl.DEPTH, 0, [1]);
        const common = ({ program, at }) => {
            gl.useProgram(program);
            gl.uniform2f(at.lens, ...this.lens);
            gl.uniform4f(at.crop, ...crop);
            gl.uniform4f(at.section, ...this.plane);
            gl.uniform1i(at.cutting, this.section ? 1 : 0);
            gl.uniform1f(at.scale, this.camera.distance);
        };
        if (this.count > 0) {
            common(this.box);
            gl.uniform1f(this.box.at.pixel, pixel);
            gl.activeTexture(gl.TEXTURE0);
            gl.bindTexture(gl.TEXTURE_2D, this.words);
            gl.uniform1i(this.box.at.words, 0);
            gl.activeTexture(gl.TEXTURE1);
            gl.bindTexture(gl.TEXTURE_2D, this.rows);
            gl.uniform1i(this.box.at.rows, 1);
            // The far sides of boxes: they are there from inside, too.
            gl.enable(gl.CULL_FACE);
            gl.cullFace(gl.FRONT);
            gl.bindVertexArray(this.boxes);
            gl.drawArraysInstanced(gl.TRIANGLES, 0, 36, this.count);
            gl.disable(gl.CULL_FACE);
        }
        if (this.groups.length) common(this.mesh);
        for (const group of this.groups) {
            gl.bindVertexArray(group.array);
            gl.drawArraysInstanced(gl.TRIANGLES, group.triangles[0] * 3, group.triangles[1] * 3, group.count);
        }
        gl.bindVertexArray(null);
        gl.disable(gl.SCISSOR_TEST);
    }

    /** Gives a buffer its light and shows it. */
    show(target, samples) {
        const gl = this.gl;
        const [width, height] = [Math.floor(target.width / samples), Math.floor(target.height / samples)];
        if (this.picture?.width !== width || this.picture?.height !== height) {
            this.free(this.picture);
            this.picture = this.image(width, height);
        }
        const { program, at } = this.shade;
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.picture.frame);
        gl.viewport(0, 0, width, height);
        gl.disable(gl.DEPTH_TEST);
        gl.useProgram(program);
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, target.seen);
        gl.uniform1i(at.buffer_, 0);
        gl.activeTexture(gl.TEXTURE1);
        gl.bindTexture(gl.TEXTURE_2D, this.colors);
        gl.uniform1i(at.colors, 1);
        gl.uniform1i(at.samples, samples);
        gl.uniform2f(at.lens, ...this.lens);
        gl.uniform3f(at.up, ...this.up);
        gl.uniform4f(at.section, ...this.plane);
        gl.uniform1f(at.scale, this.camera.distance);
        gl.uniform3f(at.line, ...this.line);
        gl.uniform1i(at.markedCount, this.marked.length);
        if (this.marked.length) gl.uniform2uiv(at.marked, this.marked.flat());
        gl.uniform2ui(at.hovered, ...this.hovered);
        gl.bindVertexArray(this.light);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        gl.bindVertexArray(null);
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.picture.frame);
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
        const [w, h] = [this.canvas.width, this.canvas.height];
        const filter = w === width && h === height ? gl.NEAREST : gl.LINEAR;
        gl.blitFramebuffer(0, 0, width, height, 0, 0, w, h, gl.COLOR_BUFFER_BIT, filter);
        this.shown = { target, samples };
    }

    /** The pixels of full resolution, and samples of a pixel along each side. */
    get whole() {
        return { width: this.canvas.width, height: this.canvas.height, samples: this.slow ? 1 : 2 };
    }

    /** A buffer of this size, kept under a name. */
    kept(name, width, height) {
        if (this[name]?.width !== width || this[name]?.height !== height) {
            this.free(this[name]);
            this[name] = this.target(width, height);
        }
        return this[name];
    }

    pixelOf(height) {
        return (2 * this.camera.field) / height;
    }

    /** True when all is drawn at full resolution. */
    get settled() {
        return !this.dirty && !this.job && !this.waiting && this.finished;
    }

    /** Draws what is to be drawn now; called once a frame, after `place`. */
    frame() {
        const gl = this.gl;
        if (this.waiting) {
            const status = gl.clientWaitSync(this.waiting.fence, 0, 0);
            if (status === gl.TIMEOUT_EXPIRED) return;
            gl.deleteSync(this.waiting.fence);
            this.waiting.done(performance.now() - this.waiting.since);
            this.waiting = null;
        }
        const now = performance.now();
        if (this.dirty) {
            this.dirty = false;
            this.finished = false;
            const width = Math.max(16, Math.round(this.canvas.width * this.part));
            const height = Math.max(16, Math.round(this.canvas.height * this.part));
            const target = this.kept("quick", width, height);
            this.march(target, [1, 1, 0, 0], this.pixelOf(height));
            this.show(target, 1);
            this.wait((took) => {
                this.part = Math.min(1, Math.max(COARSEST, this.part * Math.min(1.5, Math.max(0.4, Math.sqrt(QUICK / took)))));
                this.slow = this.part < 0.7;
            });
        } else if (!this.finished && !this.job && now - this.changed > REST) {
            const { width, height, samples } = this.whole;
            this.job = { target: this.kept("fine", width * samples, height * samples), samples, y: 0, rows: 0 };
        } else if (this.job) {
            this.tile();
        } else if (this.relit && this.shown) {
            this.relit = false;
            this.show(this.shown.target, this.shown.samples);
        }
    }

    /** The next rows of the whole, so many as take about as long as a tile may. */
    tile() {
        const job = this.job;
        const { target } = job;
        job.rows ||= Math.ceil(target.height / (this.slow ? 48 : 2));
        const rows = Math.min(job.rows, target.height - job.y);
        this.march(target, [1, 1, 0, 0], this.pixelOf(target.height), [0, job.y, target.width, rows]);
        job.y += rows;
        const last = job.y >= target.height;
        if (last) {
            this.show(target, job.samples);
            this.relit = false;
            this.finished = true;
            this.job = null;
        }
        this.wait((took) => {
            job.rows = Math.max(4, Math.round(rows * Math.min(3, Math.max(0.3, TILE / took))));
        });
    }

    wait(done) {
        const gl = this.gl;
        this.waiting = { fence: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0), since: performance.now(), done };
        gl.flush();
    }

    /** What is seen at a pixel of the page: object, face as the buffer has it, distance; none where nothing is. */
    pick(px, py) {
        const gl = this.gl;
        const [w, h] = this.camera.size;
        const [x, y] = [(px / w) * 2 - 1, 1 - (py / h) * 2];
        this.march(this.one, [w, h, -x * w, -y * h], this.pixelOf(h));
        const got = new Uint32Array(4);
        gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, got);
        if (got[0] === 0) return null;
        const far = new Float32Array(got.buffer, 12, 1)[0];
        return { object: got[0] - 1, face: got[1], far };
    }
}
