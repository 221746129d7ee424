"""Decodes CAN frames with cantools: lines `id#data` in, a line `id name signal=value ...` out.

    python3 decode.py FILE.dbc < frames
"""

import sys

import cantools

database = cantools.database.load_file(sys.argv[1], strict=True)
for line in sys.stdin:
    identifier, data = line.strip().split("#")
    message = database.get_message_by_frame_id(int(identifier, 16))
    signals = message.decode(bytes.fromhex(data), decode_choices=False, allow_truncated=True)
    print(identifier, message.name, *(f"{name}={float(value)!r}" for name, value in sorted(signals.items())))
