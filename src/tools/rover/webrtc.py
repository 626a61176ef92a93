# SPDX-License-Identifier: LGPL-2.1-or-later
"""The picture as H.264 over WebRTC, for links too slow for MJPEG. Encoded once for all browsers, and only while there is one."""
import threading

import gi

gi.require_version('GstSdp', '1.0')
gi.require_version('GstWebRTC', '1.0')
from gi.repository import GLib, Gst, GstSdp, GstWebRTC  # noqa: E402

from rover import has  # noqa: E402

ANSWER_LIMIT = 20  # time limits in seconds for an offer, and then for a connection
MOST_PEERS = 4
VIDEO = ('videoscale ! video/x-raw,width=[16,{width}],pixel-aspect-ratio=1/1 ! terrainoverlay name=overlay ! videoconvert ! video/x-raw,format=I420 '
         '! x264enc tune=zerolatency speed-preset=ultrafast bitrate=2000 key-int-max=30 ! video/x-h264,profile=constrained-baseline ! h264parse '
         '! rtph264pay pt=96 config-interval=-1 aggregate-mode=zero-latency ! application/x-rtp,media=video,encoding-name=H264,payload=96 '
         '! tee name=t allow-not-linked=true')


def available():
    """Whether all elements exist. Without nicesrc there is a webrtcbin, but the first viewer would fail."""
    return has('webrtcbin', 'nicesrc', 'dtlsenc', 'srtpenc', 'x264enc', 'h264parse', 'rtph264pay')


class Peer:
    """One browser: a queue and a webrtcbin behind the feed's tee. Used only in the main loop's thread."""

    def __init__(self, peers, feed, number, offered):
        self.peers, self.feed, self.number, self.offered = peers, feed, number, offered
        self.candidates, self.text = [], None
        # A slow browser loses packets; the others do not wait for it.
        self.queue = Gst.parse_launch('queue leaky=downstream max-size-buffers=300 max-size-bytes=0 max-size-time=0')
        self.web = Gst.parse_launch('webrtcbin bundle-policy=max-bundle')
        for element in self.queue, self.web:
            feed.pipeline.add(element)
        self.queue.link(self.web)
        self.web.emit('get-transceiver', 0).set_property('direction', GstWebRTC.WebRTCRTPTransceiverDirection.SENDONLY)
        self.web.connect('on-ice-candidate', lambda _web, line, text: self.candidates.append({'sdpMLineIndex': line, 'candidate': text}))
        self.web.connect('notify::ice-gathering-state', lambda *_: GLib.idle_add(self.on_gathered))
        self.web.connect('notify::connection-state', lambda *_: GLib.idle_add(self.on_state))
        for element in self.web, self.queue:
            element.sync_state_with_parent()
        self.pad = feed.get('t').request_pad_simple('src_%u')
        self.pad.link(self.queue.get_static_pad('sink'))
        self.web.emit('create-offer', None, Gst.Promise.new_with_change_func(lambda promise, *_: GLib.idle_add(self.on_offer, promise)))
        GLib.timeout_add_seconds(ANSWER_LIMIT, self.on_limit)

    def on_offer(self, promise):
        reply = promise.get_reply()
        offer = reply.get_value('offer') if reply else None
        if offer is None:
            self.peers.remove(self)
            return
        self.text = offer.sdp.as_text()
        self.web.emit('set-local-description', offer, Gst.Promise.new())
        self.on_gathered()

    def on_gathered(self):
        complete = self.web.get_property('ice-gathering-state') == GstWebRTC.WebRTCICEGatheringState.COMPLETE
        if complete and self.text and self.offered:
            self.offered({'viewer': self.number, 'sdp': self.text, 'candidates': self.candidates})
            self.offered = None

    def on_limit(self):
        if self.web.get_property('connection-state') != GstWebRTC.WebRTCPeerConnectionState.CONNECTED:
            self.peers.remove(self)

    def answer(self, text):
        result, sdp = GstSdp.SDPMessage.new_from_text(text)
        if result != GstSdp.SDPResult.OK:
            self.peers.remove(self)
            return
        self.web.emit('set-remote-description', GstWebRTC.WebRTCSessionDescription.new(GstWebRTC.WebRTCSDPType.ANSWER, sdp), Gst.Promise.new())

    def on_state(self):
        ended = GstWebRTC.WebRTCPeerConnectionState
        if self.web.get_property('connection-state') in (ended.FAILED, ended.CLOSED, ended.DISCONNECTED):
            self.peers.remove(self)

    def close(self):
        """Unlinks the branch from the tee while no data flows."""
        def unlinked(pad, _info):
            pad.unlink(self.queue.get_static_pad('sink'))
            GLib.idle_add(self.dispose)
            return Gst.PadProbeReturn.REMOVE
        self.pad.add_probe(Gst.PadProbeType.IDLE, unlinked)

    def dispose(self):
        self.feed.get('t').release_request_pad(self.pad)
        # Starts at the downstream end: until a browser answers, webrtcbin blocks the queue.
        for element in self.web, self.queue:
            element.set_state(Gst.State.NULL)
            self.feed.pipeline.remove(element)


class Peers:
    def __init__(self, rover):
        self.rover, self.peers, self.count = rover, {}, 0
        rover.makers['webrtc'] = lambda: rover.make_view(VIDEO)

    def offer(self):
        """Creates the offer for another browser; called by a server thread."""
        done, result = threading.Event(), {}

        def offered(offer):
            result.update(offer)
            done.set()
        if len(self.peers) >= MOST_PEERS:
            raise ValueError(f'{MOST_PEERS} viewers have H.264 already')
        self.rover.begin_watching('webrtc')
        GLib.timeout_add(50, self.add, offered, done)
        done.wait(ANSWER_LIMIT)
        if not result:
            done.set()
            raise ValueError('WebRTC gave no offer; is the camera there?')
        return result

    def add(self, offered, done):
        feed = self.rover.feeds.get('webrtc')
        if not feed and not done.is_set():
            return True  # it starts with the next frame
        if done.is_set():
            self.rover.end_watching('webrtc')
        else:
            self.count += 1
            self.peers[self.count] = Peer(self, feed, self.count, offered)
        return False

    def answer(self, number, text):
        if not isinstance(number, int) or not isinstance(text, str):
            raise ValueError('an answer is {"viewer": .., "sdp": ..}')

        def answered():
            if number in self.peers:
                self.peers[number].answer(text)
        GLib.idle_add(answered)

    def leave(self, number):
        GLib.idle_add(lambda: self.remove(self.peers.get(number)))

    def remove(self, peer):
        if not peer or not self.peers.pop(peer.number, None):
            return
        # The last viewer stops the feed, unless it has failed before.
        if self.rover.feeds.get('webrtc') is peer.feed and self.rover.watchers['webrtc'] > 1:
            peer.close()
        self.rover.end_watching('webrtc')
