// `vite dev` up to 7 moves the code of this package to `node_modules/.vite/deps`, without its other files. The server also
// has the package as it is installed.

// Bundlers know this form of an address.
export function beside() {
    return new URL('../wasm/bvh_js_bg.wasm', import.meta.url);
}

export function served(path) {
    // Not the folders of pnpm, which have node_modules of their own.
    const moved = beside().href.match(/^(.*\/node_modules)\/\.(?!.*\/node_modules\/)/);
    return moved && new URL(`${moved[1]}/bvh-search/${path}`);
}
