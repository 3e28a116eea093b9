// The interface's documentation, from its own OpenAPI document.

import { fill, h } from "./dom.js";

const content = document.getElementById("content");
const document_ = await (await fetch("/openapi.json")).json();
const name = (schema) =>
  schema?.$ref?.split("/").at(-1) ??
  (schema?.items ? `list of ${name(schema.items)}` : [schema?.type].flat().filter(Boolean).join(" or ") || "any");
const operations = Object.entries(document_.paths).flatMap(([path, item]) =>
  Object.entries(item).map(([method, operation]) => ({ path, method, operation })),
);
const body = (operation) => Object.values(operation.requestBody?.content ?? {})[0]?.schema;

fill(
  content,
  h("h2", {}, "Interface"),
  h("p", {}, document_.info.description.replaceAll("`", "")),
  h("p", {}, h("a", { href: "/openapi.json" }, `OpenAPI ${document_.openapi}`), ` · version ${document_.info.version}`),
  operations.map(({ path, method, operation }) =>
    h(
      "details",
      {},
      h(
        "summary",
        {},
        h("span", { class: "method" }, method.toUpperCase()),
        h("code", {}, path),
        " ",
        h("span", { class: "quiet" }, operation.summary ?? ""),
      ),
      operation.description && h("p", {}, operation.description),
      (operation.parameters ?? []).length > 0 &&
        h("p", {}, "Parameters: ", operation.parameters.map((p) => `${p.name} (${p.in})`).join(", ")),
      body(operation) && h("p", {}, "Body: ", h("a", { href: `#${name(body(operation))}` }, name(body(operation)))),
      h(
        "ul",
        {},
        Object.entries(operation.responses).map(([status, r]) =>
          h(
            "li",
            {},
            `${status}: ${r.description}`,
            Object.values(r.content ?? {}).map((c) => ` (${name(c.schema)})`),
          ),
        ),
      ),
    ),
  ),
  h("h2", {}, "Formats"),
  Object.entries(document_.components.schemas).map(([key, schema]) =>
    h(
      "details",
      { id: key },
      h("summary", {}, h("code", {}, key), " ", h("span", { class: "quiet" }, schema.description ?? "")),
      h("pre", {}, JSON.stringify(schema, null, 2)),
    ),
  ),
);
