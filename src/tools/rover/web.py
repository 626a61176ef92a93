# SPDX-License-Identifier: LGPL-2.1-or-later
"""The page's HTTP server: authorisation (token, Host, Origin), limits (connections, sizes, times), and requests."""
import contextlib
import hashlib
import hmac
import http.cookies
import http.server
import json
import pathlib
import socket
import sys
import threading
import time
import urllib.parse

HERE = pathlib.Path(__file__).resolve().parent
MOST_CONNECTIONS, MOST_VIEWERS, LONGEST_BODY = 32, 8, 65536
PATIENCE = 10  # time limit in seconds for a request, and for a viewer that does not read
STATUS_EVERY = 0.25
BOUNDARY = 'terrainseg-part'
HEADERS = {'Cache-Control': 'no-store', 'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
           'Cross-Origin-Resource-Policy': 'same-origin', 'Connection': 'close',
           'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; img-src 'self' blob:; "
                                      "media-src 'self' blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"}


class Refused(Exception):
    """Answers the request with this status."""

    def __init__(self, status, text):
        super().__init__(text)
        self.status = status


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 32

    def __init__(self, address, rover, token, names, context=None, webrtc=None):
        self.rover, self.token, self.context, self.webrtc = rover, token, context, webrtc
        self.cookie = 'terrainseg-' + hashlib.sha256(token.encode()).hexdigest()[:8]  # cookies do not depend on the port: a name for each rover
        self.names = {'localhost', '127.0.0.1', '::1', *names}
        self.slots = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self.deadlines, self.viewers, self.closing = {}, threading.BoundedSemaphore(MOST_VIEWERS), False
        if ':' in address[0]:
            self.address_family = socket.AF_INET6
        super().__init__(address, Handler)

    def server_bind(self):
        http.server.socketserver.TCPServer.server_bind(self)  # HTTPServer.server_bind() would query the DNS for the host name
        self.server_name, self.server_port = self.server_address[:2]

    def process_request(self, request, client_address):
        if not self.slots.acquire(blocking=False):
            self.shutdown_request(request)
            return
        self.deadlines[request] = time.monotonic() + PATIENCE
        super().process_request(request, client_address)

    def process_request_thread(self, request, client_address):
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.deadlines.pop(request, None)
            self.slots.release()

    def finish_request(self, request, client_address):
        if not self.context:
            return super().finish_request(request, client_address)
        request.settimeout(PATIENCE)
        with self.context.wrap_socket(request, server_side=True) as secure:
            self.deadlines[secure] = self.deadlines.pop(request)
            try:
                super().finish_request(secure, client_address)
            finally:
                self.deadlines.pop(secure, None)

    def handle_error(self, request, client_address):
        """Closed connections and failed TLS handshakes are not logged."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)

    def sweep(self):
        """Closes connections with an incomplete request after PATIENCE."""
        now = time.monotonic()
        for request, deadline in list(self.deadlines.items()):
            if now > deadline:
                with contextlib.suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = 'HTTP/1.1'
    server_version, sys_version = 'terrainseg-rover', ''
    timeout = PATIENCE

    def log_message(self, *_):
        pass

    def begin(self, status, kind, length=None, **headers):
        self.send_response(status)
        for name, value in {**HEADERS, 'Content-Type': kind, **headers}.items():
            self.send_header(name.replace('_', '-'), value)
        if length is not None:
            self.send_header('Content-Length', str(length))
        if self.server.context:
            self.send_header('Strict-Transport-Security', 'max-age=31536000')
        self.end_headers()
        self.close_connection = True

    def reply(self, body=None, status=200, kind='application/json', **headers):
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.begin(status, kind, len(data), **headers)
        self.wfile.write(data)

    # Authorisation

    def check_site(self):
        """Refuses requests from pages of other sites, and other host names (DNS rebinding)."""
        said = (self.headers.get('Host') or '').lower()
        try:
            host = urllib.parse.urlsplit(f'//{said}').hostname or ''
            origin = self.headers.get('Origin')
            same = origin is None or urllib.parse.urlsplit(origin).netloc.lower() == said
        except ValueError:
            raise Refused(403, 'Host or Origin is not valid') from None
        here = self.connection.getsockname()[0].removeprefix('::ffff:')
        if host not in self.server.names and host != here:
            raise Refused(403, f'the host name {host[:80]!r} is not allowed; start terrainseg-rover with --name {host[:80]}')
        other = self.headers.get('Sec-Fetch-Site') in ('cross-site', 'same-site') and self.path.split('?')[0] != '/'
        if not same or other:
            raise Refused(403, 'the request comes from the page of another site')
        return origin is not None

    def check_token(self, query, from_page):
        def right(token):
            return hmac.compare_digest(token.encode(), self.server.token.encode())
        bearer = self.headers.get('Authorization', '').removeprefix('Bearer ')
        if right(bearer):
            return
        if self.command == 'GET' and self.route == '/' and right(query.get('token', [''])[0]):
            secure = '; Secure' if self.server.context else ''
            self.begin(303, 'text/plain', 0, Location='/', Set_Cookie=f'{self.server.cookie}={self.server.token}; HttpOnly; '
                       f'SameSite=Lax; Path=/; Max-Age=31536000{secure}')
            raise ConnectionAbortedError  # answered
        try:
            cookie = http.cookies.SimpleCookie(self.headers.get('Cookie', '')).get(self.server.cookie)
        except http.cookies.CookieError:
            cookie = None
        if not cookie or not right(cookie.value):
            raise Refused(401, 'open the address with the token that terrainseg-rover printed')
        if self.command == 'POST' and not from_page:
            raise Refused(403, 'the header Origin is missing; programs send the token as Authorization: Bearer')

    def body(self):
        try:
            length = int(self.headers['Content-Length'])
        except (TypeError, ValueError):
            raise Refused(411, 'the length of the body is missing') from None
        if not 0 <= length <= LONGEST_BODY:
            raise Refused(413, f'a body has at most {LONGEST_BODY} bytes')
        data = self.rfile.read(length)
        if len(data) < length:
            raise ConnectionAbortedError
        try:
            return json.loads(data or b'null')
        except (ValueError, RecursionError):
            raise Refused(400, 'the body is not JSON') from None

    def do_GET(self):
        try:
            from_page = self.check_site()
            parts = urllib.parse.urlsplit(self.path)
            self.route = parts.path
            self.query = urllib.parse.parse_qs(parts.query)
            self.check_token(self.query, from_page)
            (self.get if self.command == 'GET' else self.post)()
        except Refused as reason:
            self.refuse(reason.status, str(reason))
        except (ValueError, OverflowError) as error:
            self.refuse(400, str(error))
        except OSError as error:
            if error.filename:  # a file of the rover, not the connection
                self.refuse(500, error.strerror)

    do_POST = do_GET

    def refuse(self, status, text):
        self.reply({'error': text}, status)
        # Reads the rest of a short request: if unread data is left, closing the connection would discard the answer.
        self.wfile.flush()
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_WR)
            self.connection.settimeout(1)
            for _ in range(64):
                if not self.connection.recv(65536):
                    break

    # Requests

    def get(self):
        self.server.deadlines.pop(self.connection, None)
        rover = self.server.rover
        if self.route in ('/', '/page.js'):
            page = self.route == '/'
            self.reply((HERE / ('page.html' if page else 'page.js')).read_bytes(),
                       kind=f"text/{'html' if page else 'javascript'}; charset=utf-8")
        elif self.route == '/live':
            self.stream(self.query.get('pictures') != ['0'], True)
        elif self.route == '/video':
            self.stream(True, False)
        elif self.route == '/status':
            self.reply(rover.status())
        elif self.route == '/settings':
            self.reply({'keys': list(rover.keys()), 'webrtc': self.server.webrtc is not None})
        elif self.route == '/settings/file' and pathlib.Path(rover.options.settings).is_file():
            self.send_file(pathlib.Path(rover.options.settings), 'terrainseg.settings')
        elif self.route.startswith('/recordings/') and (path := rover.recording_file(self.route.removeprefix('/recordings/'))):
            self.send_file(path, path.name)
        else:
            raise Refused(404, 'there is nothing here')

    def post(self):
        rover, webrtc = self.server.rover, self.server.webrtc
        actions = {'/set': lambda body: rover.set_key(body.get('name'), body.get('value')), '/window': rover.set_window,
                   '/ignore': rover.add_region, '/unignore': rover.remove_regions, '/horizon': rover.set_horizon,
                   '/learning': rover.set_learning}
        plain = {'/forget': lambda: rover.terrain.emit('reset'), '/terrain/save': rover.save_terrain, '/terrain/load': rover.load_terrain,
                 '/settings/save': rover.save_settings, '/settings/load': rover.load_settings,
                 '/record/start': rover.start_recording, '/record/stop': rover.stop_recording}
        body = self.body()
        self.server.deadlines.pop(self.connection, None)
        result = None
        if self.route in actions:
            if self.route == '/set' and not isinstance(body, dict):
                raise ValueError('a setting is {"name": .., "value": ..}')
            actions[self.route](body)
        elif self.route in plain:
            plain[self.route]()
        elif webrtc and self.route == '/offer':
            result = webrtc.offer()
        elif webrtc and self.route == '/answer' and isinstance(body, dict):
            webrtc.answer(body.get('viewer'), body.get('sdp'))
        elif webrtc and self.route == '/leave' and isinstance(body, int):
            webrtc.leave(body)
        else:
            raise Refused(404, 'there is nothing here')
        rover.made = None  # forces an update of the status
        self.reply(result)

    def send_file(self, path, name):
        with open(path, 'rb') as file:
            size = path.stat().st_size
            self.begin(200, 'application/octet-stream', size, Content_Disposition=f'attachment; filename="{name}"')
            self.connection.sendfile(file, count=size or None)

    def stream(self, pictures, status):
        """Multipart stream of pictures and the status; a slow viewer gets fewer pictures."""
        rover, peer = self.server.rover, self.query.get('peer', [''])[0]
        if not self.server.viewers.acquire(blocking=False):
            raise Refused(503, f'at most {MOST_VIEWERS} viewers are possible')
        seen = rover.begin_watching('pictures') if pictures else None
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)  # a small buffer, because queued pictures are shown late
            self.begin(200, f'multipart/x-mixed-replace; boundary={BOUNDARY}')
            status_at, last = 0.0, time.monotonic()
            while not self.server.closing:
                if pictures:
                    seen, picture = rover.next_picture(seen, STATUS_EVERY)
                else:
                    time.sleep(STATUS_EVERY)
                    picture = None
                now = time.monotonic()
                if picture:
                    self.part('image/jpeg', picture)
                    last = now
                elif not status and now - last > PATIENCE:
                    break
                if status and now - status_at >= STATUS_EVERY:
                    status_at = now
                    self.part('application/json', json.dumps(rover.status()).encode())
        finally:
            if pictures:
                rover.end_watching('pictures')
            if self.server.webrtc and peer.isdecimal():  # the page was closed; webrtcbin would notice after half a minute
                self.server.webrtc.leave(int(peer))
            self.server.viewers.release()

    def part(self, kind, data):
        self.wfile.write(f'--{BOUNDARY}\r\nContent-Type: {kind}\r\nContent-Length: {len(data)}\r\n\r\n'.encode() + data + b'\r\n')
