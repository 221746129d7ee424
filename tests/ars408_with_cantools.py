#!/usr/bin/env python3
"""An ARS408's CAN log against cantools, which reads the messages from tests/dbc/ars408.dbc.

    make NAME              write NAME.log, a made-up log, and NAME.detections.csv, what is in it
    check LOG CSV [ID]     compare what `viewshed doctor LOG --detections CSV` wrote with what cantools
                           decodes of sensor ID [default: 0]; exit code 1 if they differ
"""

import csv
import math
import random
import sys
from pathlib import Path

import cantools

DBC = cantools.database.load_file(Path(__file__).parent / "dbc" / "ars408.dbc", strict=True)
# clusters that the vendor calls valid, by their InvalidState
VALID = (0x00, 0x04, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0F, 0x10, 0x11)
NAMES = {m.frame_id: m for m in DBC.messages}
FIELDS = ["scan", "time_s", "range_m", "azimuth_deg", "elevation_deg", "radial_velocity_mps", "rcs_dbsm", "snr_db"]
# what a detection's units allow: 1 cm, 0.011 degrees, 1 cm/s, 0.5 dB
TOLERANCE = {"range_m": 0.0051, "azimuth_deg": 0.0165, "radial_velocity_mps": 0.0053, "rcs_dbsm": 0.001}


def frames(log, sensor):
    """Time, message and signals of every frame of a sensor."""
    for line in open(log, encoding="ascii"):
        time, _, frame = line.split()[:3]
        identifier, data = frame.split("#")
        raw = int(identifier, 16)
        message = NAMES.get(raw & ~0x70)
        if message and (raw >> 4) & 7 == sensor and len(data) // 2 >= message.length:
            payload = bytes.fromhex(data)[: message.length]
            yield time.strip("()"), message.name, message.decode(payload, decode_choices=False)


def scans(log, sensor):
    """Time and detections of every scan, by the marks that viewshed takes for measured."""
    current = []
    for time, name, s in frames(log, sensor):
        if name.endswith("0_Status"):
            if current:
                yield current[0], list(current[1].values())
            current = [time, {}]
        elif not current:
            continue
        elif name.endswith("1_General"):
            x, y, vx, vy = (s[k] for k in ("DistLong", "DistLat", "VrelLong", "VrelLat"))
            distance = math.hypot(x, y)
            current[1][s["ID"]] = {
                "range_m": distance,
                "azimuth_deg": math.degrees(math.atan2(y, x)),
                "radial_velocity_mps": (x * vx + y * vy) / distance,
                "rcs_dbsm": s["RCS"],
            }
        elif name == "Obj_2_Quality" and s["MeasState"] not in (1, 2, 5):
            current[1].pop(s["ID"], None)
        elif name == "Cluster_2_Quality" and (s["InvalidState"] not in VALID or s["AmbigState"] not in (3, 4)):
            current[1].pop(s["ID"], None)
    if current:
        yield current[0], list(current[1].values())


def rows(log, sensor):
    for number, (time, detections) in enumerate(scans(log, sensor)):
        for d in detections or [{}]:
            yield {"scan": number, "time_s": time, **d}


def check(log, path, sensor):
    ours = list(csv.DictReader(open(path, encoding="ascii")))
    theirs = list(rows(log, sensor))
    worst = dict.fromkeys(TOLERANCE, 0.0)
    wrong = 0 if len(ours) == len(theirs) else 1
    for mine, other in zip(ours, theirs):
        if (int(mine["scan"]), mine["time_s"]) != (other["scan"], other["time_s"]):
            wrong += 1
        for key in TOLERANCE:
            if (mine[key] == "") != (key not in other):
                wrong += 1
            elif key in other:
                off = abs(float(mine[key]) - other[key])
                worst[key] = max(worst[key], off)
                wrong += off > TOLERANCE[key]
    found = sum(key["range_m"] != "" for key in ours)
    print(f"{log}, sensor {sensor}: {theirs[-1]['scan'] + 1} scans, {found} detections, {wrong} differences from cantools;")
    print("  farthest apart: " + ", ".join(f"{key} {off:.4f}" for key, off in worst.items()))
    return 1 if wrong else 0


def make(name):
    """Two sensors for two seconds: 0 sends clusters, 3 objects."""
    rng = random.Random(408)
    lines = []

    def send(time, message, sensor, **signals):
        m = DBC.get_message_by_name(message)
        values = {s.name: 0 for s in m.signals} | signals
        data = m.encode({s.name: values[s.name] for s in m.signals}, strict=False)
        lines.append((time, f"{m.frame_id | sensor << 4:03X}#{data.hex().upper()}"))

    def general(x, y, vx, rcs):
        step = lambda value, size, offset: round((value - offset) / size) * size + offset
        return {"DistLong": step(x, 0.2, -500), "VrelLong": step(vx, 0.25, -128), "RCS": step(rcs, 0.5, -64)}

    # lane, start, speed; + moves away
    cars = [(-1.75, 20.0, 27.0), (-5.25, 60.0, 22.5), (1.75, 150.0, -30.0), (5.25, 90.0, -25.0), (-5.25, 35.0, 21.0)]
    rail = [(x, side) for x in range(15, 120, 15) for side in (-9.0, 9.0)]
    for second in range(2):
        t = 1e9 + second
        for sensor, output in ((0, 2), (3, 1)):
            state = {"NVMReadStatus": 1, "MaxDistanceCfg": 250, "SensorID": sensor, "SortIndex": 1}
            send(t, "RadarState", sensor, **state, OutputTypeCfg=output, SendQualityCfg=1, SendExtInfoCfg=output % 2)
            send(t + 1e-4, "VersionID", sensor, MajorRelease=4, MinorRelease=30, PatchLevel=1)
        for beat in range(20):
            for sensor in (0, 3):
                send(t + beat / 20 + 0.0302, "SpeedInformation", sensor)
                send(t + beat / 20 + 0.0304, "YawRateInformation", sensor, YawRate=0)
    for scan in range(28):
        for sensor in (0, 3):
            t = 1e9 + 0.002 + scan * 0.0702 + sensor * 0.01
            seen = []
            for k, (y, x, v) in enumerate(cars):
                x += v * scan * 0.0702
                if sensor == 3:
                    seen.append((x, y, v, 12.0))
                    continue
                for _ in range(rng.randint(1, 3)):
                    seen.append((x + rng.uniform(-2, 2), y + rng.uniform(-0.8, 0.8), v + rng.gauss(0, 0.1), rng.uniform(-5, 20)))
            if sensor == 0:
                seen += [(x + rng.gauss(0, 0.1), y, 0.0, rng.uniform(-10, 5)) for x, y in rail if rng.random() < 0.7]
            kind = "Obj" if sensor else "Cluster"
            counter = 2 * scan + 100
            if sensor:
                send(t, "Obj_0_Status", sensor, NofObjects=len(seen), MeasCounter=counter, InterfaceVersion=1)
            else:
                near = len(seen) // 2
                send(t, "Cluster_0_Status", sensor, NofClustersNear=near, NofClustersFar=len(seen) - near, MeasCounter=counter, InterfaceVersion=1)
            for i, (x, y, v, rcs) in enumerate(seen):
                offset = -204.6 if sensor else -102.3
                left = round((y - offset) / 0.2) * 0.2 + offset
                send(t + 3e-4 * (i + 1), f"{kind}_1_General", sensor, ID=i, DistLat=left, VrelLat=0, DynProp=int(v == 0), **general(x, y, v, rcs))
            for i in range(len(seen)):
                after = t + 3e-4 * (len(seen) + i + 1)
                if sensor:
                    send(after, "Obj_2_Quality", sensor, ID=i, MeasState=rng.choice([2, 2, 2, 2, 3]), ProbOfExist=6)
                    send(after + 1e-4, "Obj_3_Extended", sensor, ID=i, Class=1, ArelLong=0, ArelLat=0, OrientationAngle=0, Length=4.6, Width=1.8)
                else:
                    odd = rng.random()
                    send(after, "Cluster_2_Quality", sensor, ID=i, PdH0=1, AmbigState=1 if odd < 0.1 else 3, InvalidState=2 if odd > 0.95 else 8 if odd > 0.9 else 0)
    lines.sort(key=lambda line: line[0])
    with open(f"{name}.log", "w", encoding="ascii") as log:
        log.writelines(f"({time:.6f}) can0 {frame}\n" for time, frame in lines)
    for sensor in (0, 3):
        with open(f"{name}.{sensor}.detections.csv", "w", encoding="ascii", newline="") as out:
            table = csv.DictWriter(out, FIELDS, restval="", lineterminator="\n")
            table.writeheader()
            for row in rows(f"{name}.log", sensor):
                table.writerow({k: v if k in ("scan", "time_s") else f"{v:.6f}" for k, v in row.items()})


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", name]:
            make(name)
        case ["check", log, path, *rest]:
            sys.exit(check(log, path, int(rest[0]) if rest else 0))
        case _:
            sys.exit(__doc__)
