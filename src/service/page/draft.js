// The plan as it is being made: kept over reloads, with its past, as a file, and as a link.

const KEY = "lambdak plan";
const MOST_STEPS = 200;
const PARTS = ["specimen", "base", "material", "scan", "protocol", "limits", "vary", "objective", "budget", "draws"];

const partsOf = (model) => Object.fromEntries(PARTS.filter((p) => model[p] !== undefined).map((p) => [p, model[p]]));

/** A copy whose parts share nothing, so that the base stays as it is while the specimen is edited. */
export const apart = (value) => JSON.parse(JSON.stringify(value));

/** The plan that this browser keeps; nothing where there is none. */
export function kept() {
  try {
    return JSON.parse(localStorage.getItem(KEY));
  } catch {
    return null;
  }
}

/** Keeps a plan in this browser. */
export function keep(model) {
  try {
    localStorage.setItem(KEY, JSON.stringify(partsOf(model)));
  } catch {
    /* a browser may keep nothing */
  }
}

/** Goes to the plan with some of its parts replaced. */
export function usePlan(parts) {
  keep({ ...kept(), ...apart(partsOf(parts)) });
  location.hash = "#/plan";
}

/** The steps of a plan, to undo and redo. */
export class Past {
  constructor(model) {
    this.model = model;
    this.steps = [JSON.stringify(partsOf(model))];
    this.at = 0;
  }

  /** After an edit: what was undone before is gone. */
  push() {
    const now = JSON.stringify(partsOf(this.model));
    if (now === this.steps[this.at]) return;
    this.steps = [...this.steps.slice(Math.max(0, this.at + 1 - MOST_STEPS), this.at + 1), now];
    this.at = this.steps.length - 1;
  }

  can(by) {
    return this.steps[this.at + by] !== undefined;
  }

  /** One step back (-1) or forth (1). */
  go(by) {
    if (!this.can(by)) return;
    this.at += by;
    Object.assign(this.model, JSON.parse(this.steps[this.at]));
  }
}

const through = async (bytes, stream) =>
  new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());

/** A link that holds the whole plan: whoever opens it has it. */
export async function linkOf(model) {
  const bytes = await through(
    new TextEncoder().encode(JSON.stringify(partsOf(model))),
    new CompressionStream("deflate-raw"),
  );
  const text = btoa(String.fromCharCode(...bytes))
    .replaceAll("+", "-")
    .replaceAll("/", "_")
    .replaceAll("=", "");
  return `${location.origin}${location.pathname}#/plan/~${text}`;
}

/** The plan of a link. */
export async function planOfLink(text) {
  const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
  return JSON.parse(new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate-raw"))));
}

/** What a file's content gives to a plan, by its format. */
const FORMATS = {
  "specimen/1": (specimen) => ({ specimen }),
  "ogden/1": (material) => ({ material }),
  "neo_hookean/1": (material) => ({ material }),
  "mooney_rivlin/1": (material) => ({ material }),
  "yeoh/1": (material) => ({ material }),
  "gent/1": (material) => ({ material }),
  "arruda_boyce/1": (material) => ({ material }),
  "study/1": (study) => ({
    specimen: study.base,
    base: study.base,
    material: study.materials[0].material,
    scan: study.scan,
    protocol: study.protocol ?? {},
    limits: study.limits,
    vary: study.vary,
    objective: study.objective,
    budget: study.budget,
    draws: study.verification?.is_on ? study.verification.draws : 0,
  }),
};

/** The parts of a plan that a request or a file holds; an error in words where it holds none. */
export function planOfFile(text) {
  let content;
  try {
    content = JSON.parse(text);
  } catch {
    throw new Error("The file is not JSON.");
  }
  if (content.specimen) return partsOf(content);
  const read = FORMATS[content.schema];
  if (!read)
    throw new Error(
      `Files of the formats ${Object.keys(FORMATS).join(", ")} can be opened; ` +
        `this one is ${content.schema ?? "none of them"}.`,
    );
  const parts = read(content);
  if (typeof parts.specimen === "string" || typeof parts.material === "string") {
    throw new Error("This study names other files; spell its specimen and materials out, or open those files.");
  }
  return partsOf(parts);
}
