// SPDX-License-Identifier: LGPL-2.1-or-later
// Decodes a file of MAVLink frames with node-mavlink. usage: check.mjs FILE portable|fine SECONDS
import { createReadStream, statSync } from 'node:fs'
import { MavLinkPacketParser, MavLinkPacketSplitter, common, minimal } from 'node-mavlink'

const [, , file, layout, seconds] = process.argv
const registry = { ...minimal.REGISTRY, ...common.REGISTRY }
const splitter = new MavLinkPacketSplitter()
const wrong = []
const expect = (good, what) => { if (!good && wrong.length < 10) wrong.push(what) }
let bytes = 0, obstacles = 0, heartbeats = 0, sequence = 0, last = -1, informed = 0

for await (const packet of createReadStream(file).pipe(splitter).pipe(new MavLinkPacketParser())) {
  const message = packet.protocol.data(packet.payload, registry[packet.header.msgid])
  bytes += 12 + packet.header.payloadLength
  expect(packet.header.seq === (sequence++ & 255), `sequence ${packet.header.seq} at packet ${sequence - 1}`)
  expect(packet.header.sysid === 7 && packet.header.compid === 196, 'sender')
  if (message instanceof minimal.Heartbeat) {
    ++heartbeats
    expect(message.type === minimal.MavType.ONBOARD_CONTROLLER && message.autopilot === minimal.MavAutopilot.INVALID &&
      message.systemStatus === minimal.MavState.ACTIVE && message.mavlinkVersion === 3, `heartbeat ${JSON.stringify(message)}`)
  } else if (message instanceof common.ObstacleDistance) {
    ++obstacles
    const time = Number(message.timeUsec)
    expect(time > last && time - last <= 250000 || last < 0, `time ${time} after ${last}`)
    last = time
    expect(message.distances.length === 72, 'sectors')
    expect(message.frame === common.MavFrame.BODY_FRD, `frame ${message.frame}`)
    expect(message.sensorType === common.MavDistanceSensor.UNKNOWN, `sensor ${message.sensorType}`)
    expect(message.minDistance > 0 && message.minDistance < message.maxDistance, `${message.minDistance}..${message.maxDistance}`)
    for (const d of message.distances)
      expect(d === 65535 || d >= message.minDistance && d <= message.maxDistance + 1, `distance ${d}`)
    if (layout === 'portable') expect(message.increment === 5 && message.incrementF === 0 && message.angleOffset === 0, 'portable layout')
    else expect(message.incrementF > 0 && message.angleOffset < 0 &&
      Math.abs(message.angleOffset + 35.5 * message.incrementF) < 2, `fine layout ${message.angleOffset} ${message.incrementF}`)
    informed += message.distances.some(d => d !== 65535 && d !== message.minDistance)
  } else expect(false, `message ${packet.header.msgid}`)
}
expect(informed > obstacles / 2, `${informed} of ${obstacles} messages hold a distance`)
expect(bytes === statSync(file).size, `${bytes} of ${statSync(file).size} bytes were decoded`)
expect(splitter.invalidPackages === 0 && splitter.unknownPackagesCount === 0, `${splitter.invalidPackages} invalid packets`)
expect(obstacles >= 10 * seconds && obstacles <= 15 * seconds + 1, `${obstacles} OBSTACLE_DISTANCE in ${seconds} s`)
expect(Math.abs(heartbeats - seconds) <= 1, `${heartbeats} HEARTBEAT in ${seconds} s`)
console.log(`${layout}: ${obstacles} OBSTACLE_DISTANCE (${informed} with metres), ${heartbeats} HEARTBEAT, ${bytes} bytes, ` +
  (wrong.length ? `wrong: ${wrong.join('; ')}` : 'nothing lost'))
process.exit(wrong.length ? 1 : 0)
