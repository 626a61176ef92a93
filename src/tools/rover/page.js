// SPDX-License-Identifier: LGPL-2.1-or-later
'use strict';
const $ = id => document.getElementById(id);
const at = path => new URL(path, location.origin); // without the user's name that an address may hold
const HELP = {
  '': '', window: 'Drag over the ground right in front of the rover: the filter learns from this window. Reset: the default window.',
  ignore: 'Drag over parts of the vehicle or burnt-in text; tap a region to remove it.',
  horizon: 'Tap or drag to the line at which level ground ends. Reset: the filter finds it.',
};
const seen = {pictures: 0, statuses: 0}; // also read by tests
const view = $('view'), canvas = $('picture'), video = $('video'), marks = $('marks');
let tool = '', drag = null, status = null, heard = performance.now(), begun = 0, stopStream = () => {}, peer = null, viewer = 0, denied = '';

async function post(path, body = null) {
  try {
    const reply = await fetch(at(path), {method: 'POST', body: JSON.stringify(body)});
    const said = await reply.json();
    $('toast').textContent = reply.ok ? '' : said.error;
    return reply.ok ? said : null;
  } catch (error) {
    $('toast').textContent = 'The rover does not answer.';
    return null;
  }
}

// What comes: a multipart stream of pictures and status.

async function read(reply, take) {
  const reader = reply.body.getReader(), text = new TextDecoder();
  let data = new Uint8Array(0);
  for (;;) {
    const {value, done} = await reader.read();
    if (done) return;
    const more = new Uint8Array(data.length + value.length);
    more.set(data);
    more.set(value, data.length);
    data = more;
    for (;;) {
      const head = text.decode(data.subarray(0, 200)), end = head.indexOf('\r\n\r\n');
      const length = end < 0 ? null : /Content-Length: (\d+)/.exec(head.slice(0, end));
      if (!length || data.length < end + 4 + +length[1] + 2) break;
      const body = data.subarray(end + 4, end + 4 + +length[1]);
      await take(head.includes('image/jpeg'), body); // a slow browser reads later, and gets fewer pictures
      data = data.slice(end + 4 + +length[1] + 2);
    }
  }
}

async function take(isPicture, body) {
  heard = performance.now();
  if (!isPicture) {
    status = JSON.parse(new TextDecoder().decode(body));
    seen.statuses++;
    show();
    return;
  }
  const picture = await createImageBitmap(new Blob([body], {type: 'image/jpeg'}));
  if (canvas.width !== picture.width || canvas.height !== picture.height) Object.assign(canvas, {width: picture.width, height: picture.height});
  canvas.getContext('2d').drawImage(picture, 0, 0);
  picture.close();
  seen.pictures++;
}

async function stream() {
  for (;;) {
    if (document.hidden) { // without viewers the rover encodes nothing
      await new Promise(done => document.addEventListener('visibilitychange', done, {once: true}));
      continue;
    }
    const abort = new AbortController();
    stopStream = () => abort.abort();
    begun = performance.now();
    try {
      const reply = await fetch(at(`/live?pictures=${peer ? `0&peer=${viewer}` : 1}`), {signal: abort.signal});
      denied = reply.ok ? '' : (await reply.json()).error;
      if (reply.ok) {
        if (!$('settings').children.length) await offerSettings();
        await read(reply, take);
      }
    } catch (error) { /* the alarm shows it */ }
    if (!abort.signal.aborted) await new Promise(done => setTimeout(done, 1000));
  }
}
document.addEventListener('visibilitychange', () => { document.hidden ? stopStream() : heard = performance.now(); });

setInterval(() => {
  const silent = (performance.now() - heard) / 1000;
  let alarm = '';
  if (denied) alarm = `The rover refuses: ${denied}.`;
  else if (silent > 1.5) alarm = 'No connection to the rover; trying again.';
  else if (!status) alarm = 'connecting';
  else if (status.problem) alarm = `No picture from the camera: ${status.problem}.`;
  else if (status.age > 1) alarm = `No picture from the camera for ${(status.age + silent).toFixed(1)} s.`;
  $('alarm').textContent = alarm;
  $('alarm').hidden = !alarm;
  if (silent > 3 && performance.now() - begun > 3000) stopStream();
}, 250);

// What is shown.

const percent = share => `${Math.round(100 * share)} %`;

function show() {
  const s = status;
  if (s.free !== undefined) {
    const ahead = s.free === null ? 'nothing known' : `free ahead: ${s.metres ? `${s.metres.free ? 'over ' : ''}${s.metres.value.toFixed(1)} m` : `${percent(s.free)} of view`}`;
    $('free').textContent = s.flags.includes('blocked') ? `BLOCKED, ${ahead}` : ahead;
    $('free').className = s.flags.includes('blocked') ? 'blocked' : '';
    $('confidence').textContent = percent(s.confidence);
    $('traversable').textContent = percent(s.traversable);
    $('horizon').textContent = (s.horizon === null ? 'none' : `${percent(s.horizon)} from the top`) + (s.hint === null ? '' : ', set by hand');
    $('lesson').textContent = s.lesson ? `no: ${s.lesson}` : `yes; ${s.learned} of ${s.seen} frames, generation ${s.generation}`;
    $('time').textContent = `${s.ms} ms a frame`;
  }
  $('camera').textContent = s.size ? `${s.size.join(' x ')}, ${s.rate} a second` : 'no frame yet';
  $('learning').textContent = s.learning ? 'Pause learning' : 'Learn again';
  $('record').textContent = s.recording ? 'Stop' : 'Start';
  $('record').className = s.recording ? 'on' : '';
  $('recorded').textContent = s.recording ? `${s.recording.name}, ${s.recording.seconds} s` : s.note;
  const names = s.recordings.map(([name, size]) => `${name} ${size}`).join();
  if ($('files').dataset.names !== names) {
    $('files').dataset.names = names;
    $('files').replaceChildren(...s.recordings.map(([name, size]) => Object.assign(document.createElement('a'),
      {href: `/recordings/${name}`, download: name, textContent: `${name} (${(size / 1e6).toFixed(1)} MB)`})));
  }
  for (const element of document.querySelectorAll('[data-needs]')) element.hidden = !s.saved.includes(element.dataset.needs);
  for (const [name, value] of Object.entries(s.settings)) {
    const field = $(`set-${name}`);
    if (!field) continue;
    if (document.activeElement !== field && field.value !== value) field.value = value;
    field.parentElement.classList.toggle('changed', s.changed.includes(name));
  }
  draw();
}

function draw() {
  if (!status || !status.window) return;
  const rect = ([x, y, width, height], kind) => shape('rect', {x, y, width, height, class: kind});
  const row = (y, kind) => shape('line', {x1: 0, x2: 1, y1: y, y2: y, class: kind});
  const list = status.regions.map(each => rect(each, 'ignored'));
  if (tool) list.push(rect(status.window, 'window'));
  if (status.hint !== null) list.push(row(status.hint, 'hint'));
  if (drag) list.push(tool === 'horizon' ? row(drag.to[1], 'drawn') : rect(drawn(), 'drawn'));
  marks.replaceChildren(...list);
}

function shape(kind, attributes) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

// What is drawn with mouse or finger, in fractions of the picture.

function place(event) {
  const box = view.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map(share => Math.min(1, Math.max(0, share)));
}
function drawn() {
  const [[a, b], [c, d]] = [drag.from, drag.to];
  return [Math.min(a, c), Math.min(b, d), Math.abs(a - c), Math.abs(b - d)];
}
view.addEventListener('pointerdown', event => {
  if (!tool || event.button) return;
  event.preventDefault();
  view.setPointerCapture(event.pointerId);
  drag = {from: place(event), to: place(event)};
  draw();
});
view.addEventListener('pointermove', event => {
  if (!drag) return;
  drag.to = place(event);
  draw();
});
view.addEventListener('pointerup', event => {
  if (!drag) return;
  drag.to = place(event);
  const region = drawn(), tap = region[2] < 0.02 || region[3] < 0.02;
  if (tool === 'horizon') post('/horizon', drag.to[1]);
  else if (tool === 'ignore') tap ? post('/unignore', drag.to) : post('/ignore', region);
  else if (!tap) post('/window', region);
  drag = null;
  draw();
});
view.addEventListener('pointercancel', () => { drag = null; draw(); });

function choose(name) {
  tool = name;
  for (const button of document.querySelectorAll('[data-tool]')) button.setAttribute('aria-pressed', button.dataset.tool === name);
  view.classList.toggle('drawing', !!name);
  $('help').textContent = HELP[name];
  $('reset').hidden = name !== 'window' && name !== 'horizon';
  draw();
}
for (const button of document.querySelectorAll('[data-tool]')) button.onclick = () => choose(button.dataset.tool);
for (const button of document.querySelectorAll('[data-post]')) button.onclick = () => post(button.dataset.post);
$('reset').onclick = () => post(`/${tool}`, null);
$('learning').onclick = () => post('/learning', !status.learning);
$('record').onclick = () => post(status.recording ? '/record/stop' : '/record/start');
choose('');

// The settings that are offered.

async function offerSettings() {
  const offered = await (await fetch(at('/settings'))).json();
  $('settings').replaceChildren(...offered.keys.map(key => {
    const line = document.createElement('div');
    line.className = 'setting';
    const field = document.createElement(key.choices ? 'select' : 'input');
    if (key.choices) for (const word of key.choices) field.add(new Option(word));
    else Object.assign(field, {type: 'number', min: key.least, max: key.most, step: key.step});
    field.id = `set-${key.name}`;
    field.onchange = () => field.value && post('/set', {name: key.name, value: field.value});
    const label = Object.assign(document.createElement('label'), {htmlFor: field.id, textContent: key.name, title: key.blurb});
    const back = Object.assign(document.createElement('button'), {textContent: '↺', title: 'as the preset has it', onclick: () => post('/set', {name: key.name, value: null})});
    line.append(label, field, back);
    return line;
  }));
  $('h264').hidden = !offered.webrtc || !window.RTCPeerConnection;
}

// H.264 over WebRTC.

async function connect() {
  const offer = await post('/offer');
  if (!offer || !peer) return;
  await peer.setRemoteDescription({type: 'offer', sdp: offer.sdp});
  for (const candidate of offer.candidates) await peer.addIceCandidate(candidate);
  await peer.setLocalDescription(await peer.createAnswer());
  for (let tries = 0; peer && peer.iceGatheringState !== 'complete' && tries < 30; tries++) await new Promise(done => setTimeout(done, 100));
  if (!peer) return;
  await post('/answer', {viewer: offer.viewer, sdp: peer.localDescription.sdp});
  viewer = offer.viewer;
  stopStream(); // reopened with the viewer's number: when it ends, the rover removes the viewer
}
function useH264(on) {
  if (peer) peer.close();
  if (viewer) post('/leave', viewer);
  peer = on ? new RTCPeerConnection() : null;
  viewer = 0;
  $('h264').setAttribute('aria-pressed', on);
  video.hidden = !on;
  canvas.hidden = on;
  stopStream(); // restarts it with or without pictures
  if (!on) return;
  peer.ontrack = event => { video.srcObject = event.streams[0] || new MediaStream([event.track]); };
  peer.onconnectionstatechange = () => {
    if (peer && ['failed', 'closed', 'disconnected'].includes(peer.connectionState)) setTimeout(() => peer && useH264(true), 1000);
  };
  connect().catch(error => { $('toast').textContent = String(error); });
}
$('h264').onclick = () => useH264(!peer);

stream();
