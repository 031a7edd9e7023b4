// Contacts drawn over the picture: a dot at the point, an arrow along the normal, a number, and the outline of each region. What lies
// behind something is hollow and dashed.

import { add, times } from "./math.js";

const NAMESPACE = "http://www.w3.org/2000/svg";
/** Pixels of an arrow, and of half a number's disc. */
const ARROW = 52;
const DISC = 10;

function drawn(kind, attributes, parent) {
    const made = document.createElementNS(NAMESPACE, kind);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    parent.append(made);
    return made;
}

export class Marks {
    constructor(svg) {
        this.svg = svg;
        this.hidden = new Map();
    }

    /** Draws the contacts of a step: `shown` has [pair, number, is it now, is it chosen]. */
    draw(camera, shown) {
        this.svg.replaceChildren();
        this.placed = [];
        this.svg.setAttribute("viewBox", `0 0 ${camera.size[0]} ${camera.size[1]}`);
        for (const one of shown) this.regions(camera, one);
        const discs = [];
        for (const [pair, number, now, chosen] of shown) {
            const at = pair.point && camera.pixel(pair.point);
            if (!at) continue;
            const hidden = this.hidden.get(number) ?? false;
            const classes = ["contact", hidden && "behind", !now && "past", chosen && "chosen"].filter(Boolean).join(" ");
            const group = drawn("g", { class: classes, "data-contact": number }, this.svg);
            const ahead = add(pair.point, times(pair.normal, ARROW * camera.pixelLength(pair.point)));
            const tip = camera.pixel(ahead) ?? at;
            const way = [tip[0] - at[0], tip[1] - at[1]];
            const long = Math.hypot(...way);
            const along = long > 1e-6 ? way.map((w) => w / long) : [0.6, -0.8];
            if (long > 4) {
                for (const kind of ["halo", "arrow"]) {
                    const end = [tip[0] - along[0] * Math.min(8, long), tip[1] - along[1] * Math.min(8, long)];
                    drawn("line", { class: kind, x1: at[0], y1: at[1], x2: end[0], y2: end[1] }, group);
                }
            }
            if (long > 12) {
                const side = [-along[1] * 5, along[0] * 5];
                const base = [tip[0] - along[0] * 12, tip[1] - along[1] * 12];
                const corners = [tip, [base[0] + side[0], base[1] + side[1]], [base[0] - side[0], base[1] - side[1]]];
                drawn("polygon", { class: "tip", points: corners.map((c) => `${c[0]},${c[1]}`).join(" ") }, group);
            }
            drawn("circle", { class: "dot", cx: at[0], cy: at[1], r: chosen ? 6.5 : 5 }, group);
            const side = long < 0.3 * ARROW ? [0.6, -0.8] : along;
            discs.push({ number, group, from: tip, at: [tip[0] + side[0] * (DISC + 5), tip[1] + side[1] * (DISC + 5)] });
            this.placed.push({ number, at: [at[0], at[1]] });
        }
        this.number(discs, camera.size);
    }

    /** The outlines of a contact's regions. */
    regions(camera, [pair, , now]) {
        for (const region of pair.regions ?? []) {
            const seen = region.points.map((p) => camera.pixel(p));
            if (seen.length < 2 || seen.some((p) => !p)) continue;
            const points = seen.map((p) => `${p[0]},${p[1]}`).join(" ");
            const closed = region.extent === "patch" || region.points.length > 2;
            drawn(closed ? "polygon" : "polyline", { class: now ? "region" : "region past", points }, this.svg);
        }
    }

    /** Numbers that keep off each other. */
    number(discs, [width, height]) {
        for (let round = 0; round < 60; round++) {
            for (const a of discs) {
                for (const b of discs) {
                    const [dx, dy] = [a.at[0] - b.at[0], a.at[1] - b.at[1]];
                    const apart = Math.hypot(dx, dy);
                    if (a === b || apart >= 2 * DISC + 3) continue;
                    const push = 0.3 * (2 * DISC + 3 - apart) + 0.1;
                    const way = apart > 1e-6 ? [dx / apart, dy / apart] : [a.number < b.number ? 1 : -1, 0.3];
                    a.at = [a.at[0] + way[0] * push, a.at[1] + way[1] * push];
                }
                a.at[0] = Math.min(Math.max(a.at[0], DISC + 2), width - DISC - 2);
                a.at[1] = Math.min(Math.max(a.at[1], DISC + 2), height - DISC - 2);
            }
        }
        for (const disc of discs) {
            const away = Math.hypot(disc.at[0] - disc.from[0], disc.at[1] - disc.from[1]);
            const line = { class: "leader", x1: disc.from[0], y1: disc.from[1], x2: disc.at[0], y2: disc.at[1] };
            if (away > DISC + 12) drawn("line", line, disc.group);
            drawn("circle", { class: "disc", cx: disc.at[0], cy: disc.at[1], r: DISC }, disc.group);
            const text = drawn("text", { x: disc.at[0], y: disc.at[1] }, disc.group);
            text.textContent = disc.number;
        }
    }
}
