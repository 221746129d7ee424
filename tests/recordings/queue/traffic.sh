#!/bin/sh
# Makes the traffic of every queue scene anew, NAME.fcd.xml.gz.
#
#   pip install eclipse-sumo==1.28.0        # another version may give other traffic
#   tests/recordings/queue/traffic.sh
#
# The first 258 s build the queue and are not written. Training and reporting have their own seeds.
set -eu
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# vehicles are the motorway's
{ echo '<additional>'; sed -n '/<vTypeDistribution/,/<\/vTypeDistribution>/p' ../motorway/motorway.rou.xml
  echo '</additional>'; } >"$work/vehicles.typ.xml"

# NAME LAYOUT SEED SCALE SECONDS
traffic() {
    name=$1 layout=$2 seed=$3 scale=$4 seconds=$5
    # the net keeps its coordinates: x = 0 is near the radar, y = 0 the middle of the median
    netconvert --node-files "$layout.nod.xml" --edge-files "$layout.edg.xml" --connection-files "$layout.con.xml" \
        --tllogic-files "$layout.tll.xml" --offset.disable-normalization --no-turnarounds \
        --output-file "$work/net.xml" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
    sumo --net-file "$work/net.xml" --additional-files "$work/vehicles.typ.xml,../motorway/motorway.add.xml" \
        --route-files "$layout.rou.xml" --scale "$scale" --seed "$seed" --step-length 0.1 --lanechange.duration 4 \
        --end $((260 + seconds + 2)) --time-to-teleport -1 \
        --fcd-output "$work/fcd.xml" --fcd-output.filter-shapes view --fcd-output.attributes x,y,angle,type \
        --device.fcd.begin 258 --device.fcd.period 0.5 --precision 2 --no-step-log true >"$work/log" 2>&1 ||
        { cat "$work/log" >&2; exit 1; }
    # SUMO writes the hour and its command line into a comment; the traffic alone is what has to repeat
    sed -e '/^<!--/,/^-->/d' "$work/fcd.xml" | gzip -9 --no-name >"$name.fcd.xml.gz"
    echo "$name.fcd.xml.gz"
}

traffic train-1 exit 3001 1.0 90
traffic train-2 waves 3002 1.0 90
traffic exit-1 exit 4001 1.0 150
traffic exit-2 exit 4002 1.1 150
traffic waves-1 waves 4003 1.0 150
traffic waves-2 waves 4004 0.9 150

# days of the unit of exit-1, for calibration.toml
for day in $(seq 1 14); do
    traffic "exit-day-$day" exit $((6000 + day)) 1.0 90
done

# the scenes of unseen.toml
traffic exit-3 exit 7101 0.9 150
traffic exit-4 exit 7102 1.0 150
traffic waves-3 waves 7103 1.1 150
traffic waves-4 waves 7104 1.0 150
