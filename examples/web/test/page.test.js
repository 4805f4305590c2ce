// The page in headless Chromium: searches, figures, and its look at two widths, by day and by night.
import assert from 'node:assert/strict';
import { existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { chromium } from 'playwright-core';
import { TorusKnotGeometry } from 'three';
import { serve } from '../serve.js';

const programs = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
const executablePath = programs.find((path) => path && existsSync(path));
const skip = executablePath ? false : 'no Chromium is found; CHROMIUM names one';
const LONG = 240_000;
let browser;
let server;

before(async () => {
    if (skip) return;
    // PAGE names a folder of `scripts/pack`.
    server = await serve(0, process.env.PAGE);
    const args = ['--no-sandbox', '--disable-gpu', '--disable-background-networking', '--disable-quic'];
    browser = await chromium.launch({ executablePath, args });
});

after(async () => {
    await browser?.close();
    server?.close();
});

/** Opens the page; whatever it complains of or asks other servers for is in `faults`. */
async function open(width, height, colorScheme) {
    const page = await browser.newPage({ viewport: { width, height }, colorScheme });
    const own = `http://127.0.0.1:${server.address().port}/`;
    const faults = [];
    page.on('console', (message) => { if (message.type() !== 'log') faults.push(message.text()); });
    page.on('pageerror', (error) => faults.push(String(error)));
    page.on('request', (request) => {
        if (![own, 'blob:', 'data:'].some((start) => request.url().startsWith(start))) faults.push(request.url());
    });
    await page.goto(own);
    await page.waitForSelector('body[data-state=idle]');
    return { page, faults };
}

const ended = (page) => page.waitForSelector('body[data-state=done], body[data-state=error]', { timeout: LONG });

async function search(page, scene) {
    await page.selectOption('#scene', scene);
    await page.selectOption('#seconds', '2');
    await page.click('button[type=submit]');
    await page.waitForSelector('#bar:not([hidden])', { timeout: LONG });
    await ended(page);
    assert.equal(await page.evaluate(() => document.body.dataset.state), 'done', await page.textContent('#status'));
}

/** The rows of the table: title, before, after, gain. */
const figures = (page) => page.$$eval('#figures tr:not(.kind)', (rows) => rows.map((row) => [...row.cells].map((cell) => cell.textContent)));
const number = (text) => Number(text.replaceAll(/[, ×]/g, ''));

/** How many colours a canvas shows. */
const colours = (page, id) => page.$eval(`#${id}`, (canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size;
});

async function look(page, name) {
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, `${name} is wider than the window`);
    const folder = process.env.SCREENS;
    if (!folder) return;
    mkdirSync(folder, { recursive: true });
    await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
}

for (const [width, height, scheme] of [[390, 844, 'dark'], [1400, 900, 'light']]) {
    test(`a hall is searched and drawn, and its rays take fewer tests, at ${width} pixels`, { skip, timeout: LONG }, async () => {
        const { page, faults } = await open(width, height, scheme);
        await look(page, `start-${width}-${scheme}`);
        await search(page, 'hall');
        const rows = await figures(page);
        assert.equal(rows.length, 6);
        for (const [title, own, searched, gain] of rows) {
            assert.ok(number(gain) > 0 && number(own) > 0, title);
            if (title === 'tests of boxes') assert.ok(number(searched) < 0.9 * number(own), `${title}: ${own}, ${searched}`);
        }
        assert.match(await page.textContent('#verdict'), /times as many tests/);
        for (const id of ['model', 'before', 'after']) assert.ok((await colours(page, id)) > 50, id);
        // A turned model is drawn anew.
        const picture = () => page.$eval('#model', (canvas) => canvas.toDataURL());
        const first = await picture();
        const place = await page.locator('#model').boundingBox();
        await page.mouse.move(place.x + 100, place.y + 100);
        await page.mouse.down();
        await page.mouse.move(place.x + 180, place.y + 110);
        await page.mouse.up();
        await page.waitForFunction((before) => {
            const canvas = document.getElementById('model');
            return canvas.width === 320 && canvas.toDataURL() !== before;
        }, first, { timeout: LONG });
        await look(page, `hall-${width}-${scheme}`);
        assert.deepEqual(faults, []);
        await page.close();
    });
}

test('a smooth mesh is told that it gains nothing, by night', { skip, timeout: LONG }, async () => {
    const { page, faults } = await open(1400, 900, 'dark');
    await search(page, 'knot');
    assert.match(await page.textContent('#verdict'), /gains nothing/);
    await look(page, 'knot-1400-dark');
    assert.deepEqual(faults, []);
    await page.close();
});

test('a dropped model is searched, its tree is saved, and a wrong file is named', { skip, timeout: LONG }, async () => {
    const { page, faults } = await open(390, 844, 'light');
    const knot = new TorusKnotGeometry(1, 0.4, 60, 12).toNonIndexed().attributes.position;
    const lines = Array.from({ length: knot.count }, (_, at) => `v ${knot.getX(at)} ${knot.getY(at)} ${knot.getZ(at)}`);
    for (let at = 1; at <= knot.count; at += 3) lines.push(`f ${at} ${at + 1} ${at + 2}`);
    const file = (name, text) => ({ name, mimeType: 'text/plain', buffer: Buffer.from(text) });
    await page.selectOption('#seconds', '2');
    await page.setInputFiles('#file', file('knot.obj', lines.join('\n')));
    await page.waitForSelector('body[data-state=busy]');
    await ended(page);
    assert.equal((await figures(page)).length, 6);
    const [download] = await Promise.all([page.waitForEvent('download'), page.click('#save')]);
    assert.equal(download.suggestedFilename(), 'tree.bvh');
    await look(page, 'model-390-light');
    for (const [name, text, part] of [['notes.txt', 'notes', '.glb'], ['empty.obj', '# nothing', 'no triangles'], ['half.glb', 'glTF', '']]) {
        await page.setInputFiles('#file', file(name, text));
        await page.waitForSelector('body[data-state=error]', { timeout: LONG });
        const said = await page.textContent('#status');
        assert.ok(said.length > 10 && said.includes(part), `${name}: ${said}`);
        await page.evaluate(() => { document.body.dataset.state = 'idle'; });
    }
    assert.deepEqual(faults, []);
    await page.close();
});
