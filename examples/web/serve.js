// Serves this folder: npm start [-- PORT]. The page itself is static; any other server will do (`scripts/pack` collects its files).
import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('.', import.meta.url));
const types = {
    '.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript', '.wasm': 'application/wasm', '.json': 'application/json',
};

/** Serves a folder at a port of this machine, any free one if it is 0; returns the server. */
export async function serve(port, folder = here) {
    const server = createServer(async (request, response) => {
        // The path of a URL has no '..' left.
        const path = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
        const file = join(folder, normalize(path.endsWith('/') ? `${path}index.html` : path));
        const isFile = await stat(file).then((found) => found.isFile(), () => false);
        if (!isFile) {
            response.writeHead(404).end();
            return;
        }
        response.writeHead(200, { 'Content-Type': types[extname(file)] ?? 'application/octet-stream' });
        createReadStream(file).pipe(response);
    });
    await new Promise((listening) => server.listen(port, '127.0.0.1', listening));
    return server;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
    const server = await serve(Number(process.argv[2] ?? 8080));
    console.log(`http://127.0.0.1:${server.address().port}/`);
}
