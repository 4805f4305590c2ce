// Runs a WebAssembly program, as cargo's runner: node --no-warnings scripts/wasi-run.mjs PROGRAM [ARGUMENT...]
import { readFile } from "node:fs/promises";
import { argv, cwd, env } from "node:process";
import { WASI } from "node:wasi";

const [program, ...rest] = argv.slice(2);
const wasi = new WASI({
    version: "preview1",
    args: [program, ...rest],
    env,
    preopens: { "/": "/", ".": cwd() },
});
const module = await WebAssembly.compile(await readFile(program));
wasi.start(await WebAssembly.instantiate(module, wasi.getImportObject()));
