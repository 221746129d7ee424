"""Reads a recording as other people's programs do, and prints what is in it as JSON."""
import collections
import json
import math
import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

path = sys.argv[1]
seen = collections.Counter()
schemas, fields, classes, found = {}, [], set(), {}
with open(path, "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    found["profile"] = reader.get_header().profile
    for schema, channel, message, ros in reader.iter_decoded_messages():
        seen[channel.topic] += 1
        schemas[channel.topic] = schema.name
        if channel.topic == "/radar/points":
            assert message.log_time == ros.header.stamp.sec * 10**9 + ros.header.stamp.nanosec
            fields = [field.name for field in ros.fields]
            data = bytes(ros.data)
            assert len(data) == ros.width * ros.point_step, "as many bytes as are announced"
            offset = {field.name: field.offset for field in ros.fields}
            for k in range(ros.width):
                value = {n: struct.unpack_from("<f", data, k * ros.point_step + o)[0] for n, o in offset.items()}
                ranges = math.sqrt(sum(value[axis] ** 2 for axis in "xyz"))
                assert abs(ranges - value["range"]) < 0.2, (ranges, value)
        elif channel.topic == "/ground_truth/objects":
            classes.update(d.results[0].hypothesis.class_id for d in ros.detections)
        elif channel.topic == "/camera/info":
            found["camera"] = [ros.width, ros.height, ros.k[0]]
        elif channel.topic == "/camera/objects":
            found["boxes"] = found.get("boxes", 0) + len(ros.detections)
        elif channel.topic == "/tf_static":
            found["frames"] = sorted(t.header.frame_id + ">" + t.child_frame_id for t in ros.transforms)
    file.seek(0)
    found["metadata"] = {m.name: m.metadata for m in make_reader(file).iter_metadata()}
found.update(topics=dict(seen), schemas=schemas, fields=fields, classes=sorted(classes))
print(json.dumps(found))
