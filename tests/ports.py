# SPDX-License-Identifier: LGPL-2.1-or-later
"""Ports that nobody has at this moment, so that two runs of the tests do not disturb each other."""
import random
import socket


def free_port():
    """One that is free for TCP and for UDP."""
    while True:
        with socket.socket() as tcp, socket.socket(type=socket.SOCK_DGRAM) as udp:
            tcp.bind(('', 0))
            try:
                udp.bind(tcp.getsockname())
            except OSError:
                continue
            return tcp.getsockname()[1]


def free_udp_block(size=8):
    """The first of `size` neighbours, an even number as RTP wants it. Below what Linux gives to sockets without a port
    of their own (32768 on), so that none of those comes in between."""
    while True:
        base = random.randrange(16384, 32768 - size, size)
        sockets = []
        try:
            for port in range(base, base + size):
                sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                sockets[-1].bind(('', port))
            return base
        except OSError:
            continue
        finally:
            for each in sockets:
                each.close()
