// The lists beside the picture: what is chosen, what meets, which objects there are.

import { css, number, vector } from "./scene.js";

/** Objects listed at most; others are found by the filter. */
const LISTED = 200;

/** An element with a class and what is in it. */
export function made(kind, name, ...inside) {
    const element = document.createElement(kind);
    if (name) element.className = name;
    element.append(...inside);
    return element;
}

const time = (t) => t.toFixed(9);

/** Rows of a name and what it is. */
function table(rows) {
    const list = made("dl");
    for (const [name, text] of rows) list.append(made("dt", "", name), made("dd", "", text));
    return list;
}

export class Panel {
    /** `told` hears of what is clicked: contact(number), object(index). */
    constructor(told) {
        this.told = told;
        const find = (id) => document.getElementById(id);
        [this.chosen, this.contacts, this.objects, this.summary] = ["chosen", "contacts", "objects", "summary"].map(find);
        this.filter = find("filter");
        this.filter.addEventListener("input", () => this.list());
    }

    act(scene, act) {
        this.scene = scene;
        this.of = scene.acts[act];
        this.filter.value = "";
        this.filter.hidden = this.of.objects.length < 12;
        this.list();
    }

    /** The objects that the filter leaves. */
    list() {
        const word = this.filter.value.trim().toLowerCase();
        const { objects } = this.of;
        const left = objects.map((o, i) => [o, i]).filter(([o]) => o.name.toLowerCase().includes(word));
        const rows = left.slice(0, LISTED).map(([o, i]) => {
            const swatch = made("i", "swatch");
            swatch.style.background = css(this.scene.color(o.model));
            const row = made("button", "row", swatch, made("span", "name", o.name), made("span", "faint", o.fixed ? "fixed" : ""));
            row.type = "button";
            row.title = `${o.name} is of the model ${this.scene.models[o.model].name}, in ${this.scene.models[o.model].file}.`;
            row.dataset.object = i;
            row.addEventListener("click", () => this.told.object(i));
            return row;
        });
        if (left.length > LISTED) rows.push(made("p", "faint", `${left.length - LISTED} more are not listed: filter by name.`));
        if (!left.length) rows.push(made("p", "faint", word ? "No object has this in its name." : "There are no objects."));
        this.objects.replaceChildren(...rows);
        this.mark();
    }

    /** The contacts of a step. */
    step(step) {
        this.summary.textContent = step.summary;
        const rows = step.pairs.map((p, i) => {
            const when = p.time === null ? "" : `t ${time(p.time)}`;
            const head = made("span", "head", made("b", `badge ${p.status}`, String(i + 1)), made("span", "time", when));
            head.append(made("span", "faint", p.status === "contact" ? `${p.kind ?? ""} (${p.extent ?? ""})` : p.touching ? "touching" : p.status));
            const row = made("button", "row contact", head, made("span", "name", `${p.a} – ${p.b}`));
            row.type = "button";
            row.title = p.sentence;
            row.dataset.contact = i + 1;
            row.addEventListener("click", () => this.told.contact(i + 1));
            return row;
        });
        if (!rows.length) rows.push(made("p", "faint", "Nothing meets in this step."));
        this.contacts.replaceChildren(...rows);
        this.mark();
    }

    /** Rows in the foreground. */
    mark(chosen = this.now ?? {}) {
        this.now = chosen;
        for (const row of this.contacts.querySelectorAll("[data-contact]")) {
            row.classList.toggle("chosen", Number(row.dataset.contact) === chosen.contact);
        }
        for (const row of this.objects.querySelectorAll("[data-object]")) {
            row.classList.toggle("chosen", Number(row.dataset.object) === chosen.object);
        }
        for (const row of document.querySelectorAll(".row.chosen")) row.scrollIntoView({ block: "nearest" });
    }

    empty() {
        this.chosen.replaceChildren(made("p", "faint", "Click a face, a contact or an object to read about it."));
    }

    /** A contact in full. */
    contact(p, index, unit) {
        const length = (x) => `${number(x, p.resolution)}${unit ? ` ${unit}` : ""}`;
        const rows = [];
        if (p.time_lower !== null && p.time_upper !== null) {
            const bracket = `${time(p.time_lower)} to ${time(p.time_upper)}`;
            rows.push(["bracket", `${bracket} of the step`]);
        }
        if (p.point) rows.push(["point", `${vector(p.point, p.resolution)}${unit ? ` ${unit}` : ""}`]);
        if (p.normal) rows.push(["normal", `${vector(p.normal, 1e-6)}, from ${p.a} to ${p.b}`]);
        if (p.separation !== null) rows.push(["separation", length(p.separation)]);
        if (p.normal_speed !== null) rows.push(["normal speed", `${length(p.normal_speed)} a step`]);
        if (p.penetration) rows.push(["depth", length(p.penetration.depth)]);
        [p.a, p.b].forEach((name, side) => {
            if (p.faces[side].length) rows.push([name, p.faces[side].map((f) => f.text).join("; ")]);
        });
        const count = p.regions?.length ?? 0;
        if (count) {
            const extents = p.regions.map((r) => r.extent).join(", ");
            rows.push(["regions", `${count}: ${extents}${p.regions_complete === false ? "; there may be more" : ""}`]);
        }
        this.chosen.replaceChildren(made("h3", "", `Contact ${index}`), made("p", "", p.sentence), table(rows));
    }

    /** An object, and the face of it that was picked, if one was. */
    object(object, model, { face, word, at, unit }) {
        const swatch = made("i", "swatch");
        swatch.style.background = css(this.scene.color(object.model));
        const rows = [];
        if (face) {
            const subtracted = face.sense === "negative" ? " (subtracted)" : "";
            rows.push(["face", `${face.face} of ${face.name} ${face.primitive}${subtracted}`]);
            rows.push(["source", face.line ? `${face.file}, line ${face.line}` : face.file]);
        } else if (word) {
            rows.push(["face", word]);
        }
        if (at) rows.push(["seen at", `${vector(at, 0, 5)}${unit ? ` ${unit}` : ""}`]);
        rows.push(["model", `${model.name}, ${model.file}`]);
        rows.push(["group", `${object.group}${object.fixed ? "; it never moves" : ""}`]);
        const inside = [made("h3", "", swatch, object.name), table(rows)];
        if (model.note) inside.push(made("p", "note", model.note));
        this.chosen.replaceChildren(...inside);
    }
}
