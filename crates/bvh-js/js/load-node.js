// Loads the WebAssembly from this package's folder.
import { readFile } from 'node:fs/promises';
import { initSync } from '../wasm/bvh_js.js';
import { installed, isHere } from './installed-node.js';

export async function load() {
    const beside = new URL('../wasm/bvh_js_bg.wasm', import.meta.url);
    initSync({ module: await readFile(isHere(beside) ? beside : installed('wasm/bvh_js_bg.wasm')) });
}
