// The page: what the user does, and what follows from it.

import { Drawing } from "./draw.js";
import { Marks } from "./marks.js";
import { Camera, add, clamp, dot, length, sub, times, turn } from "./math.js";
import { Panel } from "./panel.js";
import { Scene, number } from "./scene.js";

const find = (id) => document.getElementById(id);
/** Seconds that a step takes to play, alone and among others. */
const ALONE = 4;
const AMONG = 0.4;
/** Times that are as good as the same. */
const SAME = 1e-9;
/** Pixels that a click may move. */
const STILL = 4;

class Page {
    async begin() {
        this.dress(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
        this.canvas = find("solids");
        this.camera = new Camera();
        this.marks = new Marks(find("marks"));
        this.panel = new Panel({ contact: (k) => this.chooseContact(k), object: (i) => this.chooseObject(i) });
        this.scene = await Scene.load();
        this.drawing = new Drawing(this.canvas, this.scene.models, this.scene.data);
        this.scene.data = null;
        document.title = `${this.scene.title} – contactd view`;
        find("title").textContent = this.scene.title;
        const acts = find("acts");
        acts.hidden = this.scene.acts.length < 2;
        acts.replaceChildren(...this.scene.acts.map((a, i) => new Option(`${i + 1}. ${a.title}`, i)));
        this.listen();
        this.size();
        await this.showAct(0);
        const notes = this.scene.models.map((m) => m.note).filter(Boolean);
        if (notes.length) this.say(notes[0]);
        if (this.scene.live !== null) this.follow();
        requestAnimationFrame((now) => this.frame(now));
    }

    dress(theme) {
        document.documentElement.dataset.theme = theme;
        const line = getComputedStyle(document.documentElement).getPropertyValue("--line");
        this.line = line.trim().split(/\s+/).map(Number);
    }

    get act() {
        return this.scene.acts[this.actAt];
    }

    get unit() {
        return this.act.unit;
    }

    async showAct(at) {
        this.playing = false;
        this.actAt = at;
        find("acts").value = at;
        const { objects, steps } = this.act;
        this.drawing.line = this.line;
        this.drawing.objects(objects, objects.map((o) => this.scene.color(o.model)));
        this.panel.act(this.scene, at);
        find("stepping").hidden = steps < 2;
        find("step").max = steps - 1;
        const live = this.scene.live !== null;
        const marks = steps > 1 && !live ? this.scene.marks(at) : null;
        await this.showStep(live ? steps - 1 : 0, true);
        // Who asked for another step meanwhile sees that one, which is not here yet.
        if (this.step) this.bestSide();
        marks?.then((m) => this.strip(m), (e) => this.trouble(e));
    }

    /** A server's steps as they are taken: the newest is shown until the user looks at another one. */
    follow() {
        this.newest = true;
        const events = new EventSource("/live");
        events.onmessage = (e) => {
            const { live, steps, ended } = JSON.parse(e.data);
            if (live !== this.scene.live) return location.reload();
            steps.forEach((n, i) => (this.scene.acts[i].steps = n));
            if (ended) {
                events.close();
                this.say(`It is over: ${ended}.`);
            }
            return this.grown().catch((x) => this.trouble(x));
        };
    }

    /** There are more steps. */
    async grown() {
        const last = this.act.steps - 1;
        find("stepping").hidden = last < 1;
        find("step").max = last;
        find("number").textContent = `${this.stepAt + 1} of ${this.act.steps}`;
        if (!this.newest || this.playing || this.turning || last === this.stepAt) return;
        this.turning = true;
        await this.showStep(last, true).finally(() => (this.turning = false));
        // Those that came meanwhile.
        if (this.act.steps - 1 > last) await this.grown();
    }

    /** Goes to a step; `opening` at its first contact, else at its beginning. */
    async showStep(at, opening, t) {
        const asked = (this.asked = (this.asked ?? 0) + 1);
        const step = await this.scene.step(this.actAt, at);
        if (asked !== this.asked) return;
        this.stepAt = at;
        this.step = step;
        this.chosen = {};
        this.panel.empty();
        this.panel.mark({});
        this.panel.step(step);
        find("step").value = at;
        find("number").textContent = `${at + 1} of ${this.act.steps}`;
        const times_ = this.meetings().map((p) => p.time);
        find("ticks").replaceChildren(...this.meetings().map((p) => {
            const tick = document.createElement("i");
            tick.className = p.status;
            tick.style.left = `${p.time * 100}%`;
            return tick;
        }));
        this.mark();
        this.setTime(t ?? (opening && times_.length ? Math.min(...times_) : 0));
    }

    /** The pairs that meet in the step. */
    meetings() {
        return this.step.pairs.filter((p) => p.time !== null && (p.status === "contact" || p.status === "overlap"));
    }

    setTime(t) {
        this.t = clamp(t, 0, 1);
        find("time").value = this.t;
        if (document.activeElement !== find("t")) find("t").value = Number(this.t.toFixed(9));
        this.move();
    }

    /** Poses of all objects now. */
    posesAt(t) {
        const poses = this.scene.poses(this.actAt, this.step, t);
        if (!find("hold").checked) return poses;
        const first = new Map();
        for (const p of this.meetings()) {
            for (const i of p.objects) first.set(i, Math.min(first.get(i) ?? 1, p.time));
        }
        const held = [...first].filter(([, when]) => when < t);
        for (const when of new Set(held.map(([, w]) => w))) {
            const then = this.scene.poses(this.actAt, this.step, when);
            for (const [i, w] of held) if (w === when) poses[i] = then[i];
        }
        return poses;
    }

    /** Something stands elsewhere. */
    move() {
        this.poses = this.posesAt(this.t);
        this.look();
    }

    /** Something is seen otherwise. */
    look() {
        this.cut();
        this.drawing.change();
        this.unmarked = true;
        this.marks.hidden.clear();
        this.looked = false;
    }

    bestSide() {
        this.camera.look(this.step.from);
        this.fit();
    }

    fit(some) {
        const corners = this.scene.corners(this.actAt, this.poses, some);
        this.camera.fit(corners.length ? corners : [[-1, -1, -1], [1, 1, 1]]);
        this.look();
    }

    /** Contacts that are drawn: now and past ones, touching pairs all the while. */
    shown() {
        const all = [];
        this.step.pairs.forEach((p, i) => {
            if (!p.point) return;
            const chosen = this.chosen.contact === i + 1;
            const now = p.time === null || p.touching || Math.abs(p.time - this.t) <= SAME;
            const past = p.time < this.t;
            if (now || past || chosen) all.push([p, i + 1, now, chosen]);
        });
        return all;
    }

    frame(now) {
        requestAnimationFrame((next) => this.frame(next));
        try {
            if (this.playing) this.play(now);
            this.last = now;
            this.size();
            this.drawing.place(this.poses, this.camera);
            this.drawing.frame();
            if (this.drawing.settled && !this.looked) {
                this.looked = true;
                this.behind();
            }
            if (this.unmarked) {
                this.unmarked = false;
                this.marks.draw(this.camera, this.shown());
            }
            const part = Math.round(this.drawing.part * 100);
            const coarse = !this.drawing.settled && part < 70;
            const word = coarse ? `Drawn at ${part} % of the resolution while it moves.` : (this.word ?? "");
            if (find("status").textContent !== word) find("status").textContent = word;
        } catch (e) {
            this.trouble(e);
            throw e;
        }
    }

    play(now) {
        const among = this.act.steps > 1;
        const rate = Number(find("speed").value) / (among ? AMONG : ALONE);
        const t = this.t + (Math.min(now - (this.last ?? now), 100) / 1000) * rate;
        if (t < 1) return this.setTime(t);
        if (this.stepAt + 1 < this.act.steps) {
            this.setTime(1);
            if (!this.turning) {
                this.turning = true;
                const next = this.showStep(this.stepAt + 1, false, 0);
                next.catch((e) => this.trouble(e)).finally(() => (this.turning = false));
                this.scene.step(this.actAt, Math.min(this.stepAt + 2, this.act.steps - 1)).catch(() => {});
            }
            return;
        }
        this.setTime(1);
        this.stop();
    }

    stop() {
        this.playing = false;
        find("play").textContent = "▶";
    }

    toggle() {
        if (this.playing) return this.stop();
        this.playing = true;
        find("play").textContent = "❚❚";
        if (this.t >= 1) {
            if (this.stepAt + 1 >= this.act.steps) this.act.steps > 1 ? this.showStep(0) : this.setTime(0);
        }
    }

    /** Which contacts lie behind something. */
    behind() {
        for (const [pair, k] of this.shown()) {
            const at = this.camera.pixel(pair.point);
            const seen = at && this.drawing.pick(at[0], at[1]);
            const slack = 2 * this.camera.pixelLength(pair.point);
            this.marks.hidden.set(k, Boolean(seen && seen.far < at[2] - slack));
        }
        this.unmarked = true;
    }

    /** What is chosen stands out. */
    mark() {
        const marked = [];
        const { contact, object, face } = this.chosen;
        const pair = contact && this.step.pairs[contact - 1];
        if (pair) {
            pair.faces.forEach((faces, side) => {
                const i = pair.objects[side];
                for (const f of faces) {
                    const told = this.scene.toldOf(this.act.objects[i].model, f.face);
                    if (told !== undefined) marked.push([i + 1, told]);
                }
            });
        } else if (object !== undefined) {
            marked.push([object + 1, face ?? 0]);
        }
        this.drawing.marked = marked.slice(0, 8);
        this.drawing.relight();
        this.unmarked = true;
        this.panel.mark(this.chosen);
    }

    chooseContact(k) {
        const pair = this.step.pairs[k - 1];
        this.chosen = { contact: k };
        this.stop();
        if (pair.time !== null && !pair.touching) this.setTime(pair.time);
        this.panel.contact(pair, k, this.unit);
        this.mark();
    }

    chooseObject(i, face, told = {}) {
        const object = this.act.objects[i];
        this.chosen = { object: i, face };
        this.panel.object(object, this.scene.models[object.model], { ...told, unit: this.unit });
        this.mark();
    }

    /** What is seen at a pixel of the page: object, face with its name, point. */
    async pick(px, py) {
        this.drawing.place(this.poses, this.camera);
        const seen = this.drawing.pick(px, py);
        if (!seen) return null;
        const object = this.act.objects[seen.object];
        const { id, word } = this.scene.faceOf(object.model, seen.face);
        const point = add(this.camera.eye, times(this.camera.ray(px, py), seen.far));
        const face = id === undefined ? null : await this.scene.name(object.model, id);
        return { object: seen.object, name: object.name, told: seen.face, id, word, face, point, far: seen.far };
    }

    async click(px, py) {
        const near = (m) => Math.hypot(m.at[0] - px, m.at[1] - py) < 9;
        const mark = this.marks.placed?.find(near);
        if (mark) return this.chooseContact(mark.number);
        const seen = await this.pick(px, py);
        if (!seen) {
            this.chosen = {};
            this.panel.empty();
            this.mark();
            return;
        }
        this.chooseObject(seen.object, seen.told, { face: seen.face, word: seen.word, at: seen.point });
        this.chosen.point = seen.point;
        this.chosen.normal = this.camera.from;
    }

    /** The section plane, as it is set. */
    cut() {
        const on = find("cutting").getAttribute("aria-pressed") === "true";
        find("plane").hidden = !on;
        if (!on) {
            this.drawing.section = null;
            return;
        }
        const axis = find("axis").value;
        if (axis === "view") this.cutAlong ??= this.camera.from;
        const along = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1], view: this.cutAlong, face: this.faceNormal }[axis] ?? [1, 0, 0];
        const reach = this.scene.corners(this.actAt, this.poses).map((c) => dot(c, along));
        const [low, high] = reach.length ? [Math.min(...reach), Math.max(...reach)] : [-1, 1];
        const at = low + (high - low) * Number(find("offset").value);
        const sign = this.flipped ? -1 : 1;
        this.drawing.section = { normal: times(along, sign), offset: at * sign };
        find("where").textContent = `${number(at, 0, 4)}${this.unit ? ` ${this.unit}` : ""}`;
    }

    /** The contacts of an act's steps, drawn behind the slider of steps. */
    strip(marks) {
        const strip = find("strip");
        const width = strip.clientWidth || 600;
        strip.width = width * devicePixelRatio;
        strip.height = 18 * devicePixelRatio;
        const pen = strip.getContext("2d");
        const style = getComputedStyle(document.documentElement);
        pen.fillStyle = style.getPropertyValue("--contact");
        pen.globalAlpha = 0.5;
        const each = strip.width / Math.max(1, this.act.steps - 1);
        for (const m of marks) pen.fillRect(m.step * each - 0.5, 0, Math.max(1, Math.min(each * 0.6, 4)), strip.height);
    }

    size() {
        const { width, height } = this.canvas.getBoundingClientRect();
        const [w, h] = [Math.max(1, Math.round(width)), Math.max(1, Math.round(height))];
        const fine = Math.min(devicePixelRatio || 1, 2);
        if (this.camera.size[0] === w && this.camera.size[1] === h && this.canvas.width === Math.round(w * fine)) return;
        this.camera.size = [w, h];
        this.canvas.width = Math.round(w * fine);
        this.canvas.height = Math.round(h * fine);
        if (this.step) this.look();
    }

    say(word) {
        this.word = word;
    }

    trouble(e) {
        find("problem").hidden = false;
        find("problem").textContent = e.message ?? String(e);
    }

    listen() {
        const guarded = (f) => (...all) => Promise.resolve(f(...all)).catch((e) => this.trouble(e));
        const on = (id, kind, f) => find(id).addEventListener(kind, guarded(f));
        on("acts", "change", (e) => this.showAct(Number(e.target.value)));
        on("fit", "click", () => this.fit());
        on("sides", "change", (e) => {
            if (e.target.value === "best") this.bestSide();
            else if (e.target.value) {
                this.camera.look(e.target.value.split(",").map(Number));
                this.fit();
            }
            e.target.value = "";
        });
        on("cutting", "click", () => this.press("cutting"));
        on("aside", "click", () => this.press("aside"));
        on("theme", "click", () => {
            const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
            localStorage.setItem("theme", theme);
            this.dress(theme);
            this.drawing.line = this.line;
            this.drawing.relight();
        });
        on("axis", "change", () => {
            this.cutAlong = null;
            if (find("axis").value === "face") this.cutThroughFace();
            this.look();
        });
        on("offset", "input", () => this.look());
        on("flip", "click", () => {
            this.flipped = !this.flipped;
            this.look();
        });
        on("play", "click", () => this.toggle());
        on("time", "input", (e) => {
            this.stop();
            this.newest = false;
            this.setTime(this.snapped(Number(e.target.value)));
        });
        on("t", "change", (e) => this.setTime(Number(e.target.value)));
        on("hold", "change", () => this.move());
        on("step", "input", (e) => this.goTo(Number(e.target.value)));
        on("before", "click", () => this.goBy(-1));
        on("after", "click", () => this.goBy(1));
        this.listenToPointer();
        addEventListener("keydown", guarded((e) => this.key(e)));
    }

    /** A contact's own time, where the slider is next to it. */
    snapped(t) {
        const near = 3 / Math.max(1, find("time").clientWidth);
        const times_ = this.meetings().map((p) => p.time).filter((x) => Math.abs(x - t) < near);
        return times_.sort((a, b) => Math.abs(a - t) - Math.abs(b - t))[0] ?? t;
    }

    cutThroughFace() {
        const { point, object } = this.chosen;
        if (!point || object === undefined) {
            this.say("Choose a face first: the plane is then laid through the point that you clicked.");
            return;
        }
        this.faceNormal = this.normalAt(point);
        const reach = this.scene.corners(this.actAt, this.poses).map((c) => dot(c, this.faceNormal));
        const [low, high] = [Math.min(...reach), Math.max(...reach)];
        find("offset").value = clamp((dot(point, this.faceNormal) - low) / (high - low || 1), 0, 1);
    }

    /** The normal of what is seen at a point, by its neighbours. */
    normalAt(point) {
        const at = this.camera.pixel(point);
        const seen = (dx, dy) => {
            const got = this.drawing.pick(at[0] + dx, at[1] + dy);
            return got && add(this.camera.eye, times(this.camera.ray(at[0] + dx, at[1] + dy), got.far));
        };
        const [a, b, c] = [seen(0, 0), seen(1, 0), seen(0, 1)];
        if (!a || !b || !c) return this.camera.from;
        const [u, v] = [sub(b, a), sub(c, a)];
        const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        const k = dot(n, this.camera.from) < 0 ? -1 : 1;
        return length(n) > 0 ? times(n, k / length(n)) : this.camera.from;
    }

    press(id) {
        const button = find(id);
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", on);
        if (id === "aside") find("panel").hidden = !on;
        this.look();
    }

    goBy(by) {
        const at = clamp(this.stepAt + by, 0, this.act.steps - 1);
        return at === this.stepAt ? undefined : this.goTo(at);
    }

    goTo(at) {
        this.newest = at === this.act.steps - 1;
        return this.showStep(at, true);
    }

    key(e) {
        if (e.ctrlKey || e.altKey || e.metaKey || ["INPUT", "SELECT"].includes(e.target.tagName) && e.key !== "Escape") return undefined;
        const own = {
            " ": () => this.toggle(),
            f: () => this.fit(),
            s: () => this.press("cutting"),
            p: () => this.press("aside"),
            Escape: () => this.click(-1, -1),
            ArrowLeft: () => this.setTime(this.t - 0.01),
            ArrowRight: () => this.setTime(this.t + 0.01),
            Home: () => this.setTime(0),
            End: () => this.setTime(1),
            PageUp: () => this.goBy(-1),
            PageDown: () => this.goBy(1),
        }[e.key.length === 1 ? e.key.toLowerCase() : e.key];
        if (!own) return undefined;
        e.preventDefault();
        return own();
    }

    listenToPointer() {
        const { canvas } = this;
        const held = new Map();
        let moved = 0;
        canvas.addEventListener("contextmenu", (e) => e.preventDefault());
        canvas.addEventListener("pointerdown", (e) => {
            canvas.setPointerCapture(e.pointerId);
            held.set(e.pointerId, [e.offsetX, e.offsetY]);
            moved = held.size > 1 ? Infinity : 0;
        });
        canvas.addEventListener("pointermove", (e) => {
            const from = held.get(e.pointerId);
            if (!from) return this.hover(e);
            const to = [e.offsetX, e.offsetY];
            const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            moved += Math.hypot(dx, dy);
            held.set(e.pointerId, to);
            if (moved < STILL) return undefined;
            if (held.size === 2) this.pinch(held, e.pointerId, from);
            else if (e.shiftKey || e.buttons & 6) this.camera.pan(dx, dy);
            else this.camera.orbit(dx, dy);
            this.look();
            return undefined;
        });
        const up = (e) => {
            const click = held.delete(e.pointerId) && moved < STILL && e.type === "pointerup" && e.button === 0;
            if (click) this.click(e.offsetX, e.offsetY).catch((x) => this.trouble(x));
        };
        canvas.addEventListener("pointerup", up);
        canvas.addEventListener("pointercancel", up);
        canvas.addEventListener("wheel", (e) => {
            e.preventDefault();
            const lines = e.deltaMode === 1 ? 16 : 1;
            this.camera.zoom(Math.exp(clamp(e.deltaY * lines, -200, 200) * 0.0018), e.offsetX, e.offsetY);
            this.look();
        }, { passive: false });
        canvas.addEventListener("dblclick", (e) => {
            this.pick(e.offsetX, e.offsetY).then((seen) => {
                if (!seen) return;
                this.camera.target = seen.point;
                this.camera.distance = Math.min(this.camera.distance, seen.far);
                this.look();
            }, (x) => this.trouble(x));
        });
    }

    /** Two fingers: apart to zoom, along to pan. */
    pinch(held, id, from) {
        const [a, b] = [...held.entries()];
        const now = [a[1], b[1]];
        const before = [a[0] === id ? from : a[1], b[0] === id ? from : b[1]];
        const apart = ([p, q]) => Math.hypot(p[0] - q[0], p[1] - q[1]) || 1;
        const middle = ([p, q]) => [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
        const [m, was] = [middle(now), middle(before)];
        this.camera.pan(m[0] - was[0], m[1] - was[1]);
        this.camera.zoom(apart(before) / apart(now), m[0], m[1]);
    }

    /** What the pointer is over stands out a little, where that costs little. */
    hover(e) {
        if (!this.drawing.settled || this.drawing.slow) return undefined;
        const seen = this.drawing.pick(e.offsetX, e.offsetY);
        const now = seen ? [seen.object + 1, seen.face] : [0, 0];
        if (now.join() !== this.drawing.hovered.join()) {
            this.drawing.hovered = now;
            this.drawing.relight();
        }
        return undefined;
    }

    /** Waits until all is drawn at full resolution. */
    async settled() {
        const next = () => new Promise((done) => requestAnimationFrame(done));
        do await next(); while (!this.drawing.settled || !this.looked || this.unmarked || this.drawing.relit);
    }

    /** Waits until something is drawn. */
    async drawn() {
        const next = () => new Promise((done) => requestAnimationFrame(done));
        do await next(); while (this.drawing.dirty || this.drawing.waiting);
    }
}

const page = new Page();
// What tests/view asks.
window.contactdView = page;
page.ready = page.begin().catch((e) => page.trouble(e));
// A vector turned by a rotation, for who reads poses.
page.turn = turn;
