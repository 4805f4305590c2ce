// `vite dev` up to 7 moves the code of this package to `node_modules/.vite/deps`, without its other files. The server also
// has the package as it is installed.
const moved = import.meta.url.match(/^(.*)\/\.vite\/deps/);

export function served(path) {
    return moved && new URL(`${moved[1]}/bvh-search/${path}`);
}
