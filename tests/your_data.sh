#!/bin/sh
# The commands of the user's guide, on files that other libraries wrote.
set -eu
cd "$(dirname "$0")/.."
. tests/tools.sh
need_compilers
target=${CARGO_TARGET_DIR:-$PWD/target}
# VIEWSHED: one that is built already
viewshed=${VIEWSHED:-$target/release/viewshed}
[ -n "${VIEWSHED:-}" ] || cargo build --release --locked --package viewshed-harness
folder=$target/your_data
rm -rf "$folder"
mkdir -p "$folder/bin"
ln -s "$(realpath "$viewshed")" "$folder/bin/viewshed"
# made ready by mcap_ros2.sh and cantools.sh
for writer in mcap_ros2:bag cantools:bus; do
    "$target/${writer%:*}/bin/python" tests/your_data.py "${writer#*:}" "$folder" 2>/dev/null ||
        skip "${writer%:*}" "the guide's commands (tests/${writer%:*}.sh installs it)"
done
# every block of commands, as it stands on the page
sed -n '/^```sh$/,/^```$/{/^```/!p}' tests/GUIDE.md >"$folder/commands.sh"
[ "$(wc -l <"$folder/commands.sh")" -ge 4 ]
(cd "$folder" && PATH=$folder/bin:$PATH sh -eux commands.sh) >"$folder/said.txt" 2>&1 || { cat "$folder/said.txt"; exit 1; }
for said in 'radar-3d' 'drive.labels.csv' 'sensor 0 on 1: Clusters, 28 of 28 scans' 'files into bus-map'; do
    grep -q "$said" "$folder/said.txt" || { cat "$folder/said.txt"; echo "your_data: \`$said\` was not said"; exit 1; }
done
[ -f "$folder/map/birdseye-radar-3d.png" ] && [ -f "$folder/results.json" ] && [ -f "$folder/bus-map/birdseye-radar-3d.png" ]
echo "the commands of tests/GUIDE.md do what they say"
