// What is shown, as the program tells it: models, acts, steps with their answers, names of faces.

import { add, poseAt, turn } from "./math.js";
import { BY_ID, CUT, ENDS, NO_FACE } from "./shaders.js";

async function asked(path) {
    const answer = await fetch(path);
    if (!answer.ok) throw new Error((await answer.text()).trim());
    return answer;
}

const json = async (path) => (await asked(path)).json();
const bytes = async (path) => (await asked(path)).arrayBuffer();

/** Linear colours of the models, in their order: those of the program's pictures. */
export const COLORS = [
    [0.4, 0.44, 0.49], [0.72, 0.43, 0.1], [0.08, 0.22, 0.42], [0.52, 0.09, 0.06],
    [0.1, 0.31, 0.2], [0.3, 0.13, 0.36], [0.45, 0.4, 0.3], [0.06, 0.32, 0.36],
];

/** A linear colour as the style sheet has it. */
export const css = (c) => `rgb(${c.map((x) => Math.round(255 * x ** (1 / 2.2))).join(" ")})`;

export class Scene {
    static async load() {
        const [told, words, rows, triangles] = await Promise.all([
            json("/show.json"), bytes("/words.bin"), bytes("/rows.bin"), bytes("/triangles.bin"),
        ]);
        const scene = new Scene();
        Object.assign(scene, { ...told, data: { words, rows, triangles } });
        for (const model of scene.models) {
            model.idOf = new Map();
            model.rowsOf = new Map();
            for (let i = 0; i < model.faces.length; i += 2) {
                model.idOf.set(model.faces[i], model.faces[i + 1]);
                model.rowsOf.set(model.faces[i + 1], model.faces[i]);
            }
        }
        scene.steps = new Map();
        scene.names = new Map();
        return scene;
    }

    /** A step of an act, kept from then on. */
    step(act, step) {
        const key = `${act}/${step}`;
        if (!this.steps.has(key)) {
            if (this.steps.size > 400) this.steps.clear();
            this.steps.set(key, json(`/step/${key}`));
        }
        return this.steps.get(key);
    }

    marks(act) {
        return json(`/marks/${act}`);
    }

    /** The poses of an act's models at a moment of a step. */
    poses(act, step, t) {
        return this.acts[act].objects.map((_, i) => poseAt(step.motions[i], step.places[i], t));
    }

    /** The colour of a model. */
    color(model) {
        return COLORS[model % COLORS.length];
    }

    /** The face that a buffer's number means: its id within the model, or what it is instead of one. */
    faceOf(model, told) {
        if (told === CUT) return { word: "The section plane cuts it here." };
        if (told === ENDS) return { word: "It is endless, and drawn up to here." };
        if (told === NO_FACE) return { word: "The triangle there is too thin to have a face." };
        const id = told >= BY_ID ? told - BY_ID : this.models[model].idOf.get(told);
        return { id };
    }

    /** A face's number in the buffer. */
    toldOf(model, id) {
        const { triangles, rowsOf } = this.models[model];
        return triangles[1] > 0 ? id + BY_ID : rowsOf.get(id);
    }

    /** What a face is called. */
    name(model, id) {
        const key = `${model}/${id}`;
        if (!this.names.has(key)) this.names.set(key, json(`/face/${key}`));
        return this.names.get(key);
    }

    /** The corners of the boxes of an act's objects. */
    corners(act, poses, some) {
        const all = [];
        this.acts[act].objects.forEach((o, i) => {
            const { low, high, endless } = this.models[o.model];
            if (endless || (some && !some.has(i)) || low[0] >= high[0]) return;
            for (let k = 0; k < 8; k++) {
                const c = [0, 1, 2].map((axis) => ((k >> axis) & 1 ? high[axis] : low[axis]));
                all.push(add(poses[i].position, turn(poses[i].rotation, c)));
            }
        });
        return all;
    }
}

/** A number to so many significant digits, without trailing zeros; what is below `quantum` is 0. */
export function number(x, quantum = 0, digits = 6) {
    if (Math.abs(x) <= quantum || x === 0) return "0";
    const size = Math.floor(Math.log10(Math.abs(x)));
    if (size < -5 || size > 8) return x.toExponential(Math.min(digits - 1, 5)).replace(/\.?0+e/, "e");
    const known = quantum > 0 ? Math.ceil(-Math.log10(quantum) - 1e-9) : 20;
    const decimals = Math.max(0, Math.min(known, digits - 1 - size, 20));
    const text = x.toFixed(decimals);
    const short = text.includes(".") ? text.replace(/\.?0+$/, "") : text;
    return short === "-0" ? "0" : short;
}

export const vector = (v, quantum, digits) => `(${v.map((x) => number(x, quantum, digits)).join(", ")})`;
