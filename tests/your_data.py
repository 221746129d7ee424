#!/usr/bin/env python3
"""Recordings as people bring them, written by libraries that know nothing of viewshed, of what ships with it.

    bag FOLDER     drive.mcap by mcap-ros2-support: a cloud with x, y, z and velocity and nothing else, 20 s of the
                   shipped recording; drive.labels.csv beside it, as a spreadsheet exports it
    bus FOLDER     bus.asc by python-can: the shipped log of an ARS408
"""

import csv
import math
import struct
import sys
from pathlib import Path

HERE = Path(__file__).parent
DURATION_S = 20.0


def bag(folder):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from mcap_ros2.writer import Writer

    definition = (HERE / "harness/src/recording/msg/PointCloud2.msg").read_text()
    names = ["x", "y", "z", "velocity"]
    with open(HERE / "recordings/motorway.mcap", "rb") as source, open(folder / "drive.mcap", "wb") as target, open(
        folder / "drive.labels.csv", "w", newline="", encoding="utf-8"
    ) as labels:
        rows = csv.writer(labels)
        rows.writerow(["time_s", "object_id", "class", "x_m", "y_m", "heading_rad"])
        writer = Writer(target)
        schema = writer.register_msgdef("sensor_msgs/msg/PointCloud2", definition)
        start = None
        reader = make_reader(source, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(topics=["/radar/points", "/ground_truth/objects"]):
            stamp = message.header.stamp
            time_ns = stamp.sec * 10**9 + stamp.nanosec
            start = time_ns if start is None else start
            time_s = (time_ns - start) * 1e-9
            if time_s > DURATION_S:
                break
            if channel.topic != "/radar/points":
                for d in message.detections:
                    kind = d.results[0].hypothesis.class_id
                    if kind not in ("car", "van", "truck", "bus"):
                        continue
                    p, q = d.bbox.center.position, d.bbox.center.orientation
                    heading = 2 * math.atan2(q.z, q.w)
                    rows.writerow([f"{time_s:.3f}", d.id, kind, f"{p.x:.2f}", f"{p.y:.2f}", f"{heading:.4f}"])
                continue
            offsets = {f.name: f.offset for f in message.fields}
            wanted = ["x", "y", "z", "radial_velocity"]
            data = b"".join(
                struct.pack("<4f", *(struct.unpack_from("<f", message.data, at + offsets[name])[0] for name in wanted))
                for at in range(0, len(message.data), message.point_step)
            )
            cloud = {
                "header": {"stamp": {"sec": stamp.sec, "nanosec": stamp.nanosec}, "frame_id": "radar_front"},
                "height": 1,
                "width": len(data) // 16,
                "fields": [{"name": n, "offset": 4 * k, "datatype": 7, "count": 1} for k, n in enumerate(names)],
                "is_bigendian": False,
                "point_step": 16,
                "row_step": len(data),
                "data": data,
                "is_dense": True,
            }
            writer.write_message("/radar_front/cloud", schema, cloud, log_time=time_ns, publish_time=time_ns)
        writer.finish()


def bus(folder):
    import can

    with can.ASCWriter(str(folder / "bus.asc")) as target:
        for message in can.CanutilsLogReader(str(HERE / "recordings/ars408-made-up.log")):
            target.on_message_received(message)


if __name__ == "__main__":
    {"bag": bag, "bus": bus}[sys.argv[1]](Path(sys.argv[2]))
