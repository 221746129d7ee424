#!/bin/sh
# Makes the traffic of every crossing scene anew, NAME.fcd.xml.gz, and the net of every layout, LAYOUT.net.xml.gz.
#
#   pip install eclipse-sumo==1.28.0        # another version may give other traffic
#   tests/recordings/crossing/traffic.sh
#
# The first 198 s fill the roads and are not written. Training and reporting have their own seeds.
set -eu
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# cars and vans are the motorway's
{ echo '<additional>'; sed -n '/<vTypeDistribution id="light"/,/<\/vTypeDistribution>/p' ../motorway/motorway.rou.xml
  echo '</additional>'; } >"$work/light.typ.xml"

# NAME LAYOUT ROUTES SEED CYCLE_S SCALE SECONDS
traffic() {
    name=$1 layout=$2 routes=$3 seed=$4 cycle=$5 scale=$6 seconds=$7
    # the net keeps its coordinates; bicycles get lanes, walkers pavements and crossings
    netconvert --node-files "$layout.nod.xml" --edge-files "$layout.edg.xml" --offset.disable-normalization \
        --no-turnarounds --sidewalks.guess --sidewalks.guess.max-speed 17 --crossings.guess --crossings.guess.speed-threshold 17 --bikelanes.guess \
        --tls.cycle.time "$cycle" --output-file "$work/net.xml" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
    sumo --net-file "$work/net.xml" --additional-files "$work/light.typ.xml,town.typ.xml,view.add.xml" \
        --route-files "$routes.rou.xml" --scale "$scale" --seed "$seed" --step-length 0.1 --end $((200 + seconds + 2)) \
        --time-to-teleport -1 \
        --fcd-output "$work/fcd.xml" --fcd-output.filter-shapes view --fcd-output.attributes x,y,angle,type \
        --device.fcd.begin 198 --device.fcd.period 0.5 --precision 2 --no-step-log true >"$work/log" 2>&1 ||
        { cat "$work/log" >&2; exit 1; }
    sed -e '/^<!--/,/^-->/d' "$work/net.xml" | gzip -9 --no-name >"$layout.net.xml.gz"
    # SUMO writes the hour and its command line into a comment; the traffic alone is what has to repeat
    sed -e '/^<!--/,/^-->/d' "$work/fcd.xml" | gzip -9 --no-name >"$name.fcd.xml.gz"
    echo "$name.fcd.xml.gz"
}

traffic train-1 small crossing 1001 80 1.0 90
traffic train-2 wide crossing 1002 90 1.0 90
traffic wide-1 wide crossing 2001 80 1.0 150
traffic wide-2 wide crossing 2002 100 1.2 150
traffic skewed-1 skewed crossing 2003 80 0.9 150
traffic skewed-2 skewed crossing 2004 90 0.9 150
traffic tee-1 tee tee 2005 70 1.1 150
traffic tee-2 tee tee 2006 90 1.2 150

# the scenes of unseen.toml
traffic wide-3 wide crossing 7001 90 1.1 150
traffic skewed-3 skewed crossing 7002 100 0.9 150
traffic tee-3 tee tee 7003 80 1.1 150
traffic broad-1 broad crossing 7004 100 1.3 150
traffic broad-2 broad crossing 7005 90 1.2 150
traffic narrow-1 narrow crossing 7006 70 0.6 150

# other traffic past each of these, which lanes are learnt from
before() { traffic "$1-before" "$2" "$3" "$4" "$5" "$6" 90; }
before wide-3 wide crossing 7101 90 1.1
before skewed-3 skewed crossing 7102 100 0.9
before tee-3 tee tee 7103 80 1.1
before broad-1 broad crossing 7104 100 1.3
before broad-2 broad crossing 7105 90 1.2
before narrow-1 narrow crossing 7106 70 0.6

# days of the unit of wide-1, for calibration.toml
for day in $(seq 1 14); do
    traffic "wide-day-$day" wide crossing $((5000 + day)) 80 1.0 90
done

# days of the other layouts, for tuning.toml
for day in $(seq 1 6); do
    traffic "skewed-day-$day" skewed crossing $((6000 + day)) 90 0.9 90
    traffic "tee-day-$day" tee tee $((6100 + day)) 90 1.1 90
done
