// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads a recording with @mcap/core, every checksum on, and decodes every message with @foxglove/rosmsg2-serialization.
// usage: check.mjs whole FILE LINES FRAMES    a finished file: its values are those of the JSON lines; at least FRAMES of them
//        check.mjs finished FILE FRAMES       a finished file of which there are no lines
//        check.mjs prefix FILE FRAMES         what a killed recorder left: at least FRAMES frames can be read
import { open, readFile } from 'node:fs/promises'
import { McapIndexedReader, McapStreamReader } from '@mcap/core'
import { parse } from '@foxglove/rosmsg'
import { MessageReader } from '@foxglove/rosmsg2-serialization'
import { decompress } from 'fzstd'

const [, , mode, file, ...rest] = process.argv
const wrong = []
const expect = (good, what) => { if (!good && wrong.length < 10) wrong.push(what); return good }
const decompressHandlers = { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) }
const types = {
  '/terrain/scan': 'sensor_msgs/msg/LaserScan', '/terrain/points': 'sensor_msgs/msg/PointCloud2', '/terrain/grid': 'nav_msgs/msg/OccupancyGrid',
  '/terrain/mask': 'sensor_msgs/msg/Image', '/camera/camera_info': 'sensor_msgs/msg/CameraInfo', '/camera/video': 'foxglove_msgs/msg/CompressedVideo',
  '/tf': 'tf2_msgs/msg/TFMessage', '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray' }
const perFrame = Object.keys(types).filter(topic => topic !== '/diagnostics')

/// Every message by topic, in the order of the file; throws where a record or a checksum is wrong.
function stream(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers })
  const schemas = new Map(), channels = new Map(), topics = {}, kinds = {}
  reader.append(bytes)
  for (let record; (record = reader.nextRecord());) {
    kinds[record.type] = (kinds[record.type] ?? 0) + 1
    if (record.type === 'Header') expect(record.profile === 'ros2', `profile ${record.profile}`)
    else if (record.type === 'Schema') schemas.set(record.id, record)
    else if (record.type === 'Channel') {
      const schema = schemas.get(record.schemaId)
      expect(schema.encoding === 'ros2msg' && record.messageEncoding === 'cdr' && record.metadata.has('offered_qos_profiles'), record.topic)
      expect(schema.name === types[record.topic], `${record.topic} is ${schema.name}`)
      channels.set(record.id, { topic: record.topic, reader: new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })) })
    } else if (record.type === 'Message') {
      const { topic, reader: decoder } = channels.get(record.channelId)
      const list = topics[topic] ??= []
      expect(record.sequence === list.length, `${topic}: sequence ${record.sequence}`)
      list.push({ time: record.logTime, message: decoder.readMessage(record.data) })
    }
  }
  return { topics, kinds, done: reader.done() }
}

const stamp = t => BigInt(t.sec) * 1000000000n + BigInt(t.nanosec ?? t.nsec)
const near = (a, b, tolerance) => Math.abs(a - b) <= tolerance

/// The line's columns: range null = unknown, Infinity = free.
const columns = metric => metric.bearings.map((bearing, i) => ({
  bearing, range: metric.free[i] ? Infinity : metric.ranges[i], low: metric.low[i], high: metric.high[i] }))

function checkPoints(cloud, metric, where) {
  const ends = columns(metric).filter(c => c.range !== null && c.range !== Infinity)
  if (!expect(cloud.width === ends.length && cloud.height === 1 && cloud.data.length === cloud.row_step && cloud.point_step === 20 && !cloud.is_bigendian, `${where}: ${cloud.width} points, ${ends.length} ends`)) return
  expect(cloud.fields.map(f => `${f.name}${f.offset}:${f.datatype}`).join() === 'x0:7,y4:7,z8:7,low12:7,high16:7', `${where}: fields`)
  const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.length)
  ends.forEach((end, i) => {
    const [x, y, z, low, high] = [0, 4, 8, 12, 16].map(offset => view.getFloat32(20 * i + offset, true))
    expect(near(x, end.range * Math.cos(end.bearing), 0.002) && near(y, end.range * Math.sin(end.bearing), 0.002) && z === 0, `${where}: point ${i}`)
    // The lines end at range_max.
    expect((end.low === null ? Number.isNaN(low) : near(Math.min(low, metric.range_max), end.low, 0.001)) &&
      (end.high === null ? Number.isNaN(high) : near(Math.min(high, metric.range_max), end.high, 0.001)), `${where}: point ${i} low ${low} high ${high}`)
  })
}

function checkScan(scan, metric, where) {
  // A column on the edge of two beams may be in either: numbers of single precision.
  const beams = Array.from(scan.ranges, () => ({ sure: [], maybe: [] }))
  for (const { bearing, range } of columns(metric).filter(c => c.bearing !== null)) {
    const place = (bearing - scan.angle_min) / scan.angle_increment, edge = Math.abs(place - Math.floor(place) - 0.5) < 0.02
    for (const beam of edge ? [Math.floor(place), Math.floor(place) + 1] : [Math.round(place)])
      beams[beam]?.[edge ? 'maybe' : 'sure'].push(range)
  }
  const value = range => range === null ? Infinity : range
  scan.ranges.forEach((range, i) => {
    const { sure, maybe } = beams[i], least = Math.min(...sure.map(value))
    if (sure.length === 0 && Number.isNaN(range)) return
    expect(sure.length + maybe.length > 0, `${where}: beam ${i} is ${range} without a column`)
    expect(Number.isFinite(range) ? range < least + 0.001 && [...sure, ...maybe].some(r => r !== null && near(r, range, 0.001))
      : least === Infinity && (Number.isNaN(range) ? [...sure, ...maybe].includes(null) : !sure.includes(null)),
    `${where}: beam ${i} is ${range}, its columns ${sure} and perhaps ${maybe}`)
  })
  expect(beams.filter(beam => beam.sure.length + beam.maybe.length > 0).length > 0.8 * beams.length, `${where}: the fan is wider than the view`)
  expect(near(scan.range_min, metric.range_min, 0.001) && near(scan.range_max, metric.range_max, 0.001), `${where}: limits`)
  expect(near(scan.angle_max, scan.angle_min + (scan.ranges.length - 1) * scan.angle_increment, 1e-4) && scan.intensities.length === 0, `${where}: angles`)
}

function checkGrid(grid, metric, where) {
  const { resolution, width, height, origin } = grid.info
  expect(grid.data.length === width * height && grid.data.every(cell => cell === 0 || cell === 100 || cell === -1), `${where}: cells`)
  for (const { bearing, range } of columns(metric)) {
    if (range === null || range === Infinity) continue
    // A millimetre of rounding may move an end into the next cell.
    const around = [-0.001, 0.001].flatMap(dx => [-0.001, 0.001].map(dy => grid.data[
      Math.floor((range * Math.sin(bearing) + dy - origin.position.y) / resolution) * width + Math.floor((range * Math.cos(bearing) + dx - origin.position.x) / resolution)]))
    expect(around.includes(100), `${where}: no obstacle at ${range} m, ${bearing}`)
  }
  return grid.data.some(cell => cell === 0)
}

function checkMask(image, mask, where) {
  if (!expect(image.width === mask.width && image.height === mask.height && image.step === mask.width && image.encoding === 'mono8', `${where}: ${image.width}x${image.height}`)) return
  let at = 0
  for (let i = 0; i < mask.runs.length; i += 2)
    for (const end = at + mask.runs[i + 1]; at < end; ++at)
      if (!expect(image.data[at] === mask.runs[i], `${where}: pixel ${at}`)) return
  expect(at === image.data.length, `${where}: ${at} of ${image.data.length} pixels`)
}

function checkTransform(tf, metric, where) {
  const [{ header, child_frame_id, transform: { translation: t, rotation: q } }] = tf.transforms
  expect(header.frame_id === 'base_link' && child_frame_id === 'camera_optical', `${where}: frames`)
  expect(near(t.z, metric.height, 0.001) && near(t.x, 0.2, 1e-9) && t.y === 0, `${where}: translation`)
  // The camera's z looks ahead and down by the pitch.
  const z = [2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x * q.x + q.y * q.y)]
  expect(near(Math.atan2(-z[2], z[0]), metric.pitch, 2e-5) && near(z[1], 0, 1e-6), `${where}: rotation ${z}`)
}

/// Types of the NAL units of an access unit.
function nalTypes(data) {
  const found = []
  for (let i = 0; i + 3 < data.length; ++i)
    if (data[i] === 0 && data[i + 1] === 0 && data[i + 2] === 1) found.push(data[i + 3] & 31)
  return found
}

function checkVideo(messages) {
  let keys = 0
  messages.forEach(({ message }, i) => {
    const found = nalTypes(message.data)
    expect(message.format === 'h264' && found.some(type => type === 1 || type === 5), `video ${i}: ${found}`)
    if (!found.includes(5)) return
    ++keys
    expect(found.includes(7) && found.includes(8), `video ${i}: a key frame without parameter sets`)
  })
  expect(nalTypes(messages[0].message.data).includes(5), 'video begins with a key frame')
  return keys
}

/// Two seconds from the middle, found by the index: the messages that are there, without reading the rest.
async function checkSeek(topics, size) {
  const handle = await open(file)
  let taken = 0n
  const readable = {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      taken += length
      const bytes = new Uint8Array(Number(length))
      await handle.read(bytes, 0, bytes.length, Number(offset))
      return bytes
    } }
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers })
  const times = topics['/terrain/mask'].map(m => m.time)
  const startTime = times[Math.floor(times.length / 2)], endTime = startTime + 500000000n
  const expected = Object.entries(topics).flatMap(([topic, list]) => list.filter(m => m.time >= startTime && m.time <= endTime).map(m => `${topic} ${m.time}`)).sort()
  const found = []
  let last = 0n
  for await (const message of reader.readMessages({ startTime, endTime, validateCrcs: true })) {
    expect(message.logTime >= last, 'messages come in the order of time')
    last = message.logTime
    found.push(`${reader.channelsById.get(message.channelId).topic} ${message.logTime}`)
  }
  expect(found.sort().join() === expected.join() && found.length > 0, `a seek gives ${found.length} messages, not ${expected.length}`)
  expect(Number(taken) < 0.75 * size, `a seek read ${taken} of ${size} bytes`)
  const total = Object.values(topics).reduce((sum, list) => sum + list.length, 0)
  expect(Number(reader.statistics.messageCount) === total, 'statistics')
  await handle.close()
  return Number(taken)
}

const bytes = new Uint8Array(await readFile(file))
const { topics, kinds, done } = stream(bytes)
/// What a topic's messages have in common for as long as the stream goes on.
const geometry = {
  '/terrain/scan': m => [m.angle_min, m.angle_max, m.angle_increment, m.range_min, m.range_max, m.ranges.length],
  '/terrain/grid': m => [m.info.resolution, m.info.width, m.info.height, m.info.origin.position.x, m.info.origin.position.y],
  '/terrain/mask': m => [m.width, m.height], '/terrain/points': m => [m.point_step, m.height],
  '/camera/camera_info': m => [m.width, m.height, ...m.k, ...m.d, ...m.p] }
for (const [topic, list] of Object.entries(topics)) {
  const seen = new Set(list.map(m => (geometry[topic]?.(m.message) ?? []).join()))
  expect(seen.size === 1, `${topic}: ${seen.size} geometries: ${[...seen].slice(0, 2).join(' | ')}`)
  expect(list.every((m, i) => i === 0 || m.time > list[i - 1].time), `${topic}: time does not rise`)
}
const frames = topics['/terrain/mask']?.length ?? 0
let said = ''
if (mode === 'prefix') {
  const [least] = rest
  expect(!done && kinds.DataEnd === undefined, 'it ends like a whole file')
  expect(frames >= Number(least), `${frames} frames`)
} else {
  const [linesFile, least] = mode === 'finished' ? [null, ...rest] : rest
  expect(done && kinds.Footer === 1 && kinds.Statistics === 1 && kinds.ChunkIndex > 1, `records ${JSON.stringify(kinds)}`)
  expect(frames >= Number(least), `${frames} frames`)
  const lines = linesFile ? (await readFile(linesFile, 'utf8')).trim().split('\n').map(line => JSON.parse(line)) : []
  if (linesFile) for (const topic of perFrame)
    expect(topics[topic]?.length === lines.length, `${topic}: ${topics[topic]?.length} messages, ${lines.length} lines`)
  expect(topics['/diagnostics']?.every(({ message }) => message.status.length === 1 && message.status[0].values.length === 5), 'diagnostics')
  let drivable = 0
  if (wrong.length === 0)
    lines.forEach((line, i) => {
      const at = topic => topics[topic][i].message
      // The clock of the recording: the time of day, told to the microsecond by the line, or the line's stream time.
      const time = line.utc ? BigInt(Date.parse(line.utc.slice(0, 19) + 'Z')) * 1000000n + BigInt(line.utc.slice(20, 26)) * 1000n : BigInt(line.pts)
      for (const topic of perFrame)
        expect(line.utc ? topics[topic][i].time / 1000n === time / 1000n : topics[topic][i].time === time, `${topic} ${i}: time ${topics[topic][i].time}, not ${time}`)
      expect(stamp(at('/terrain/scan').header.stamp) === topics['/terrain/scan'][i].time && stamp(at('/camera/video').timestamp) === topics['/camera/video'][i].time, `stamp ${i}`)
      checkPoints(at('/terrain/points'), line.metric, `points ${i}`)
      checkScan(at('/terrain/scan'), line.metric, `scan ${i}`)
      drivable += checkGrid(at('/terrain/grid'), line.metric, `grid ${i}`)
      checkMask(at('/terrain/mask'), line.mask, `mask ${i}`)
      checkTransform(at('/tf'), line.metric, `tf ${i}`)
      const info = at('/camera/camera_info')
      expect(info.width === 320 && info.height === 180 && Array.from(info.k).join() === '262.4,0,159.5,0,262.4,89.5,0,0,1' && info.distortion_model === 'plumb_bob', `camera info ${i}`)
    })
  expect(!linesFile || drivable > lines.length / 2, `${drivable} grids with free cells`)
  const keys = topics['/camera/video'] ? checkVideo(topics['/camera/video']) : 0
  const taken = wrong.length === 0 ? await checkSeek(topics, bytes.length) : 0
  said = `, ${keys} key frames, a seek read ${taken} bytes`
}
console.log(`${mode}: ${frames} frames, ${kinds.Message} messages, ${bytes.length} bytes${said}: ` + (wrong.length ? `wrong: ${wrong.join('; ')}` : 'all as it should be'))
process.exit(wrong.length ? 1 : 0)
