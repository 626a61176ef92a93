#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The annotated view of a rover in a browser: WebRTC video, and one JSON object per frame over a data channel.

usage: webrtc_sender.py [--port 8080] [--source 'v4l2src ! decodebin']        then open http://127.0.0.1:8080/
       WEB_USER=me WEB_PASSWORD=... webrtc_sender.py --host 0.0.0.0               then open http://ROVER:8080/

Packages: gstreamer1.0-nice, gstreamer1.0-plugins-bad, gir1.2-gst-plugins-bad-1.0, python3-gi. Signalling is two HTTP
requests, all candidates in one go: the page asks for an offer and posts its answer. For a network that blocks peers set
--stun. The pictures are encrypted, the page and its password are not (HTTP): beyond a network that is yours put it
behind a server with TLS (docs/security.md).
"""
import argparse
import base64
import hmac
import http.server
import ipaddress
import json
import os
import pathlib
import sys
import threading

import gi

gi.require_version('Gst', '1.0')
gi.require_version('GstSdp', '1.0')
gi.require_version('GstWebRTC', '1.0')
from gi.repository import GLib, Gst, GstSdp, GstWebRTC  # noqa: E402

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'python'))
import find_plugin  # noqa: E402

PAGE = pathlib.Path(__file__).resolve().parent / 'page.html'
NO_CAMERA = """Is a camera there, and free (v4l2-ctl --list-devices)?
  another one:       --source 'v4l2src device=/dev/video2 ! decodebin'
  without a camera:  --source 'terrainscenesrc is-live=true ! video/x-raw,framerate=30/1'"""
ANSWER_LIMIT = 20  # seconds to an answer, then the viewer is given up


class Viewer:
    """One browser: a queue and a webrtcbin behind the tee. Lives in the main loop's thread."""

    def __init__(self, rover, number, offered):
        self.rover, self.number, self.offered = rover, number, offered
        self.candidates, self.offer = [], None
        self.answered = False
        self.queue = Gst.ElementFactory.make('queue')
        # A browser that does not keep up loses frames; the others do not wait for it.
        self.queue.set_property('leaky', 2)
        self.queue.set_property('max-size-buffers', 300)
        self.queue.set_property('max-size-bytes', 0)
        self.queue.set_property('max-size-time', 0)
        self.web = Gst.ElementFactory.make('webrtcbin')
        self.web.set_property('bundle-policy', GstWebRTC.WebRTCBundlePolicy.MAX_BUNDLE)
        if rover.options.stun:
            self.web.set_property('stun-server', rover.options.stun)
        rover.pipeline.add(self.queue)
        rover.pipeline.add(self.web)
        self.queue.link(self.web)
        self.web.get_property('signaling-state')
        transceiver = self.web.emit('get-transceiver', 0)
        transceiver.set_property('direction', GstWebRTC.WebRTCRTPTransceiverDirection.SENDONLY)
        self.web.connect('on-ice-candidate', self.on_candidate)
        self.web.connect('notify::ice-gathering-state', lambda *_: GLib.idle_add(self.on_gathered))
        self.web.connect('notify::connection-state', lambda *_: GLib.idle_add(self.on_state))
        self.web.sync_state_with_parent()
        self.queue.sync_state_with_parent()
        self.channel = self.web.emit('create-data-channel', 'terrain',
                                     Gst.Structure.new_from_string('options,ordered=true'))
        self.pad = rover.tee.request_pad_simple('src_%u')
        self.pad.link(self.queue.get_static_pad('sink'))
        promise = Gst.Promise.new_with_change_func(lambda p, *_: GLib.idle_add(self.on_offer, p))
        self.web.emit('create-offer', None, promise)
        GLib.timeout_add_seconds(ANSWER_LIMIT, self.on_limit)

    def on_offer(self, promise):
        reply = promise.get_reply()
        offer = reply.get_value('offer') if reply else None
        if offer is None:
            self.rover.remove(self)
            return
        self.offer = offer.sdp.as_text()
        self.web.emit('set-local-description', offer, Gst.Promise.new())
        self.on_gathered()

    def on_candidate(self, _web, line, candidate):
        self.candidates.append({'sdpMLineIndex': line, 'candidate': candidate})

    def on_gathered(self):
        complete = self.web.get_property('ice-gathering-state') == GstWebRTC.WebRTCICEGatheringState.COMPLETE
        if complete and self.offer and self.offered:
            self.offered({'viewer': self.number, 'sdp': self.offer, 'candidates': self.candidates})
            self.offered = None

    def on_limit(self):
        if not self.answered:
            self.rover.remove(self)

    def answer(self, text):
        result, sdp = GstSdp.SDPMessage.new_from_text(text)
        if result != GstSdp.SDPResult.OK:
            self.rover.remove(self)
            return
        self.answered = True
        description = GstWebRTC.WebRTCSessionDescription.new(GstWebRTC.WebRTCSDPType.ANSWER, sdp)
        self.web.emit('set-remote-description', description, Gst.Promise.new())

    def on_state(self):
        state = self.web.get_property('connection-state')
        if state in (GstWebRTC.WebRTCPeerConnectionState.FAILED, GstWebRTC.WebRTCPeerConnectionState.CLOSED,
                     GstWebRTC.WebRTCPeerConnectionState.DISCONNECTED):
            self.rover.remove(self)

    def tell(self, line):
        if self.channel and self.channel.get_property('ready-state') == GstWebRTC.WebRTCDataChannelState.OPEN:
            if self.channel.get_property('buffered-amount') < 1_000_000:
                self.channel.emit('send-string', line)

    def close(self):
        """Takes the branch off the tee while nothing flows through it."""
        def unlinked(pad, _info):
            pad.unlink(self.queue.get_static_pad('sink'))
            GLib.idle_add(self.dispose)
            return Gst.PadProbeReturn.REMOVE
        self.pad.add_probe(Gst.PadProbeType.IDLE, unlinked)

    def dispose(self):
        self.rover.tee.release_request_pad(self.pad)
        # From the end on: until a browser has answered webrtcbin holds on to what the queue pushes, and the queue would
        # wait for it for ever.
        for element in self.web, self.queue:
            element.set_state(Gst.State.NULL)
            self.rover.pipeline.remove(element)
        self.channel = None


class Rover:
    def __init__(self, options):
        self.options = options
        self.viewers, self.next_number = {}, 1
        self.frames = 0
        # The queue behind the tee of the JSON lines and the encoder keep all frames; only the camera's end is leaky.
        self.pipeline = Gst.parse_launch(
            f'{options.source} ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 '
            f'! terrainseg {options.settings} ! tee name=seen '
            # Browsers take VP8 as BT.601, whatever it was made from.
            'seen. ! queue ! terrainoverlay ! videoconvert ! video/x-raw,format=I420,colorimetry=bt601 ! vp8enc name=encoder deadline=1 cpu-used=8 threads=2 '
            f'target-bitrate={options.bitrate * 1000} keyframe-max-dist=60 error-resilient=partitions '
            '! rtpvp8pay pt=96 picture-id-mode=15-bit ! application/x-rtp,media=video,encoding-name=VP8,payload=96 '
            '! tee name=t allow-not-linked=true '
            'seen. ! queue ! terrainextract ! application/x-ndjson ! appsink name=lines emit-signals=true sync=false')
        self.tee = self.pipeline.get_by_name('t')
        self.pipeline.get_by_name('lines').connect('new-sample', self.on_line)

    def on_line(self, lines):
        buffer = lines.emit('pull-sample').get_buffer()
        line = buffer.extract_dup(0, buffer.get_size()).decode().rstrip()
        GLib.idle_add(self.tell, line)
        return Gst.FlowReturn.OK

    def tell(self, line):
        self.frames += 1
        for viewer in self.viewers.values():
            viewer.tell(line)

    def add(self, offered):
        viewer = Viewer(self, self.next_number, offered)
        self.viewers[viewer.number] = viewer
        self.next_number += 1

    def answer(self, number, sdp):
        if number in self.viewers:
            self.viewers[number].answer(sdp)

    def remove(self, viewer):
        if self.viewers.pop(viewer.number, None):
            viewer.close()


class Handler(http.server.BaseHTTPRequestHandler):
    rover = None
    secret = None   # what Authorization has to say; None = anybody may look
    reports = None  # where a test page leaves what it saw

    def log_message(self, *_):
        pass

    def reply(self, code, body=b'', kind='application/json'):
        self.send_response(code)
        self.send_header('Content-Type', kind)
        self.send_header('Content-Length', str(len(body)))
        self.send_header('Cache-Control', 'no-store')
        self.end_headers()
        self.wfile.write(body)

    def is_allowed(self):
        """Whether the password came; if not, the browser is asked for it."""
        said = self.headers.get('Authorization') or ''
        if self.secret is None or hmac.compare_digest(said.encode(), self.secret):
            return True
        self.send_response(401)
        self.send_header('WWW-Authenticate', 'Basic realm="rover", charset="UTF-8"')
        self.send_header('Content-Length', '0')
        self.send_header('Connection', 'close')  # a body that was not read must not be taken for a request
        self.end_headers()
        return False

    def body(self):
        length = int(self.headers.get('Content-Length') or 0)
        if not 0 <= length <= 8_000_000:
            raise ValueError('too long')
        return self.rfile.read(length)

    def do_GET(self):
        if not self.is_allowed():
            return
        if self.path.split('?')[0] == '/':
            self.reply(200, PAGE.read_bytes(), 'text/html; charset=utf-8')
        else:
            self.reply(404)

    def do_POST(self):
        if not self.is_allowed():
            return
        try:
            body = self.body()
            if self.path == '/offer':
                done, result = threading.Event(), {}

                def offered(offer):
                    result.update(offer)
                    done.set()
                GLib.idle_add(self.rover.add, offered)
                done.wait(ANSWER_LIMIT)
                self.reply(200 if result else 503, json.dumps(result).encode())
            elif self.path == '/answer':
                answer = json.loads(body)
                GLib.idle_add(self.rover.answer, int(answer['viewer']), str(answer['sdp']))
                self.reply(204)
            elif self.path == '/report' and self.reports:
                self.reports(body)
                self.reply(204)
            else:
                self.reply(404)
        except (ValueError, KeyError, TypeError) as error:
            self.reply(400, json.dumps({'error': str(error)}).encode())


def secret_for(options, parser):
    """The header that a browser has to send; None on this machine alone or with --open."""
    user, password = os.environ.get('WEB_USER'), os.environ.get('WEB_PASSWORD')
    if bool(user) != bool(password):
        parser.error('set both WEB_USER and WEB_PASSWORD, or neither')
    if user:
        return b'Basic ' + base64.b64encode(f'{user}:{password}'.encode())
    try:
        loopback = options.host == 'localhost' or ipaddress.ip_address(options.host).is_loopback
    except ValueError:
        loopback = False
    if not loopback and not options.open:
        parser.error(f'on {options.host} everybody could watch: set WEB_USER and WEB_PASSWORD, or say --open')
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--host', default='127.0.0.1', help='address to listen on (127.0.0.1); others want WEB_USER and WEB_PASSWORD')
    parser.add_argument('--open', action='store_true', help='no password, whatever the address')
    parser.add_argument('--port', type=int, default=8080)
    parser.add_argument('--source', default='v4l2src ! decodebin', help='piece of a pipeline that gives raw video')
    parser.add_argument('--settings', default='', help='properties of terrainseg, as in gst-launch-1.0')
    parser.add_argument('--bitrate', type=int, default=2000, help='kilobits a second')
    parser.add_argument('--stun', help='such as stun://stun.example.org:3478')
    parser.add_argument('--report', help='for tests: a file for what the page at /?report says it saw')
    options = parser.parse_args()
    if not 1 <= options.port <= 65535:
        parser.error(f'{options.port} is no port: say one from 1 to 65535')

    Handler.secret = secret_for(options, parser)

    find_plugin.init()
    loop = GLib.MainLoop()
    try:
        rover = Rover(options)
    except GLib.Error as error:
        sys.exit(f'webrtc_sender: {error.message}')
    Handler.rover = rover
    if options.report:
        def write(body):
            part = pathlib.Path(options.report + '.part')
            part.write_bytes(body)
            part.replace(options.report)
        Handler.reports = staticmethod(write)

    result = []

    def on_message(_bus, message):
        if message.type == Gst.MessageType.ERROR:
            error, _ = message.parse_error()
            inside = next((viewer for viewer in rover.viewers.values() if message.src.has_as_ancestor(viewer.web)), None)
            if inside:  # one browser's trouble is not the rover's
                rover.remove(inside)
                return
            result.append(f'webrtc_sender: {message.src.get_name()}: {error.message}')
            loop.quit()
        elif message.type == Gst.MessageType.EOS:
            loop.quit()

    bus = rover.pipeline.get_bus()
    # The camera is opened before the first browser comes, and before the address is told.
    if rover.pipeline.set_state(Gst.State.READY) == Gst.StateChangeReturn.FAILURE:
        message = bus.pop_filtered(Gst.MessageType.ERROR)
        cause = message.parse_error()[0].message if message else 'it does not say why'
        rover.pipeline.set_state(Gst.State.NULL)
        sys.exit(f'webrtc_sender: the source cannot be opened: {cause}\n{NO_CAMERA}')
    bus.add_signal_watch()
    bus.connect('message', on_message)
    try:
        server = http.server.ThreadingHTTPServer((options.host, options.port), Handler)
    except OSError as error:
        sys.exit(f'webrtc_sender: {options.host}:{options.port} cannot be listened on: {error.strerror}; choose another --port or --host')
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    rover.pipeline.set_state(Gst.State.PLAYING)
    print(f'http://{options.host}:{server.server_port}/', flush=True)
    try:
        loop.run()
    except KeyboardInterrupt:
        pass
    server.shutdown()
    rover.pipeline.set_state(Gst.State.NULL)
    viewers = rover.next_number - 1
    print(f'{rover.frames} {"frame" if rover.frames == 1 else "frames"}, {viewers} {"viewer" if viewers == 1 else "viewers"}', flush=True)
    sys.exit(result[0] if result else 0)


if __name__ == '__main__':
    main()
