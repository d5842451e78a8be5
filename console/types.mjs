// Writes src/wire.ts, the wire's types, from wire.schema.json, which `python -m tools.wire_schema` writes.
import { readFileSync, writeFileSync } from "node:fs";
import { compile } from "json-schema-to-typescript";

const schema = JSON.parse(readFileSync(new URL("wire.schema.json", import.meta.url), "utf8"));
const text = await compile(schema, "Wire", {
  additionalProperties: false,
  bannerComment: "// Made from wire.schema.json by types.mjs; not to be edited.",
});
writeFileSync(new URL("src/wire.ts", import.meta.url), text);
