#!/bin/sh
# Makes the traffic of every day, day-0.fcd.xml.gz to day-23.fcd.xml.gz, anew, and that of days with few heavy
# vehicles, light-1.fcd.xml.gz to light-5.fcd.xml.gz, and ten minutes each, long-1.fcd.xml.gz to long-5.fcd.xml.gz.
#
#   pip install eclipse-sumo==1.28.0        # or Debian's package sumo; another version may give other traffic
#   tests/recordings/motorway/traffic.sh
#
# Day N is SUMO's seed 100 + N, light day N 200 + N, long day N 300 + N. The first 199 s fill the road and are not written.
set -eu
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# the net keeps its coordinates: x = 0 is the radar, y = 0 the middle of the median
netconvert --node-files motorway.nod.xml --edge-files motorway.edg.xml --offset.disable-normalization \
    --output-file "$work/net.xml" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
# traffic NAME ROUTES SEED END PERIOD
traffic() {
    sumo --net-file "$work/net.xml" --route-files "$2" --additional-files motorway.add.xml \
        --seed "$3" --step-length 0.1 --lanechange.duration 4 --end "$4" \
        --fcd-output "$work/fcd.xml" --fcd-output.filter-shapes view --fcd-output.attributes x,y,angle,type \
        --device.fcd.begin 199 --device.fcd.period "$5" --precision 2 --no-step-log true >"$work/log" 2>&1 ||
        { cat "$work/log" >&2; exit 1; }
    # SUMO writes the hour and its command line into a comment; the traffic alone is what has to repeat
    sed -e '/^<!--/,/^-->/d' "$work/fcd.xml" | gzip -9 --no-name >"$1.fcd.xml.gz"
    echo "$1.fcd.xml.gz"
}
for day in $(seq 0 23); do
    traffic "day-$day" motorway.rou.xml $((100 + day)) 262 0.5
done
for day in 1 2 3 4 5; do
    traffic "light-$day" light.rou.xml $((200 + day)) 262 0.5
done
# vehicles do not stop coming after five minutes; places a second apart keep the files small
sed 's/end="300"/end="900"/' motorway.rou.xml >"$work/long.rou.xml"
for day in 1 2 3 4 5; do
    traffic "long-$day" "$work/long.rou.xml" $((300 + day)) 802 1
done
