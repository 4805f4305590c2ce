// Loads the WebAssembly from this package's folder.
import { readFile } from 'node:fs/promises';
import { initSync } from '../wasm/bvh_js.js';

export async function load() {
    initSync({ module: await readFile(new URL('../wasm/bvh_js_bg.wasm', import.meta.url)) });
}
