// The page: a model, a search in a worker, and both trees beside each other.
import { bakeInWorker } from 'bvh-search';
import { bestOwn, gain, meanTests, pause, raysInside, speeds } from './compare.js';
import { loadModel } from './load.js';
import { draw, drawScale, View } from './pictures.js';
import { outside, scenes } from './scenes.js';

/** Below this gain of tests, nobody would notice. */
const WORTHWHILE = 1.05;
/** Rays of each kind whose tests are counted and whose time is taken. */
const RAYS = 12_000;
const ROUNDS = 9;

const part = (id) => document.getElementById(id);
const whole = (value) => value.toLocaleString('en', { maximumFractionDigits: 0 });
const fine = (value) => value.toLocaleString('en', { minimumFractionDigits: 2, maximumFractionDigits: 2 });
const one = (value) => value.toLocaleString('en', { minimumFractionDigits: 1, maximumFractionDigits: 1 });

/** Ends the work on a model, and what is shown of it. */
let current = new AbortController();
let shown;

function say(text, isError = false) {
    part('status').textContent = text;
    part('status').classList.toggle('error', isError);
}

/** Shows a model from a function that makes it. */
async function run(make, place) {
    current.abort();
    current = new AbortController();
    const { signal } = current;
    part('result').hidden = true;
    part('bar').hidden = true;
    document.body.dataset.state = 'busy';
    try {
        say('Loading …');
        await pause();
        const geometry = await make();
        await compare(geometry, place, signal);
        document.body.dataset.state = 'done';
    } catch (error) {
        // A newer run speaks for itself.
        if (signal.aborted && current.signal !== signal) return;
        part('bar').hidden = true;
        document.body.dataset.state = 'error';
        if (signal.aborted) say('Stopped.');
        else say(error.message, true);
    }
}

async function compare(geometry, place, signal) {
    const triangles = geometry.attributes.position.count / 3;
    say(`${whole(triangles)} triangles. three-mesh-bvh builds its own trees …`);
    const view = new View(geometry, place);
    const every = Math.max(1, Math.floor((320 * 240) / RAYS));
    const kinds = {
        'rays of the picture': view.rays().filter((_, pixel) => pixel % every === 0),
        'rays in all directions': raysInside(geometry, RAYS),
    };
    const own = await bestOwn(geometry, Object.values(kinds).flat());
    signal.throwIfAborted();
    say(`${whole(triangles)} triangles. Searching …`);
    part('progress').value = 0;
    part('bar').hidden = false;
    const tree = await bakeInWorker(geometry, {
        seconds: Number(part('seconds').value),
        onProgress: ({ fraction }) => { part('progress').value = fraction; },
        signal,
    });
    part('bar').hidden = true;
    const trees = [own.bvh, tree.toMeshBVH(geometry)];
    const gains = [];
    const rows = [];
    for (const [kind, rays] of Object.entries(kinds)) {
        say(`Tracing ${kind} …`);
        await pause();
        signal.throwIfAborted();
        const tests = trees.map((bvh) => meanTests(bvh, rays));
        gains.push(gain(...tests));
        const { rates, ratio } = await speeds(trees, rays, ROUNDS);
        const less = (count) => `${fine(tests[0][count] / tests[1][count])} ×`;
        rows.push(
            [kind],
            ['tests of boxes', ...tests.map(({ boxes }) => one(boxes)), less('boxes')],
            ['tests of triangles', ...tests.map(({ triangles }) => one(triangles)), less('triangles')],
            ['rays per second', ...rates.map(whole), `${fine(ratio)} ×`],
        );
    }
    signal.throwIfAborted();
    showFigures(rows);
    showVerdict(gains.reduce((product, one) => product * one) ** (1 / gains.length));
    part('method').textContent = `${whole(triangles)} triangles. Before: the library's best tree by these rays, which is SAH with `
        + `leaves of ${own.targetLeafSize}. After: the searched tree. Speeds are of this machine, in turns, and their gain is the `
        + `median of ${ROUNDS} rounds; tests are the same on every machine.`;
    URL.revokeObjectURL(part('save').href);
    part('save').href = URL.createObjectURL(new Blob([tree.save()]));
    part('result').hidden = false;
    say('Drawing …');
    shown = { view, trees, most: undefined };
    await redraw(1);
    part('most').textContent = whole(shown.most);
    say('');
}

function showFigures(rows) {
    part('figures').replaceChildren(...rows.map(([title, ...figures]) => {
        const row = document.createElement('tr');
        const head = document.createElement('th');
        head.scope = figures.length ? 'row' : 'rowgroup';
        head.textContent = title;
        row.append(head);
        if (figures.length === 0) {
            row.className = 'kind';
            head.colSpan = 4;
        }
        for (const figure of figures) row.insertCell().textContent = figure;
        return row;
    }));
}

function showVerdict(factor) {
    document.body.dataset.gain = factor;
    part('verdict').textContent = factor >= WORTHWHILE
        ? `A ray takes ${fine(factor)} times as many tests in the best tree of three-mesh-bvh as in the searched one.`
        : 'This model gains nothing worth mentioning: keep the tree of three-mesh-bvh. Smooth surfaces of small triangles '
          + 'leave little to search for.';
}

let drawing = 0;
async function redraw(coarse) {
    const mine = ++drawing;
    const { view, trees, most } = shown;
    const canvases = ['model', 'before', 'after'].map(part);
    shown.most = await draw(view, trees, canvases, { coarse, most, isWanted: () => mine === drawing });
}

for (const canvas of ['model', 'before', 'after'].map(part)) {
    let from;
    canvas.addEventListener('pointerdown', (event) => {
        from = event;
        canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener('pointermove', (event) => {
        if (!from) return;
        const angle = 4 / canvas.clientWidth;
        shown.view.turn((event.clientX - from.clientX) * angle, (event.clientY - from.clientY) * angle);
        from = event;
        redraw(4);
    });
    const end = () => {
        if (from) redraw(1);
        from = undefined;
    };
    canvas.addEventListener('pointerup', end);
    canvas.addEventListener('pointercancel', end);
}

for (const [name, { title }] of Object.entries(scenes)) part('scene').add(new Option(title, name));
drawScale(part('scale'));
const runFile = (file) => file && run(() => loadModel(file), outside);
part('choice').addEventListener('submit', (event) => {
    event.preventDefault();
    const scene = scenes[part('scene').value];
    run(scene.make, { ...outside, ...scene });
});
part('file').addEventListener('change', (event) => {
    runFile(event.target.files[0]);
    // The same file may be chosen again, for longer.
    event.target.value = '';
});
part('stop').addEventListener('click', () => current.abort());
addEventListener('dragover', (event) => {
    event.preventDefault();
    document.body.classList.add('dropping');
});
addEventListener('dragleave', () => document.body.classList.remove('dropping'));
addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('dropping');
    runFile(event.dataTransfer.files[0]);
});
document.body.dataset.state = 'idle';
