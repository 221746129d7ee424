#!/bin/sh
# A small network and a picture for the tests of viewshed-detector, fetched into target/detector and never shipped: the
# CenterNet of npm's @vladmandic/human as ONNX, and a street's picture of PyPI's ultralytics.
# With --install only these are made ready, for tests run with VIEWSHED_DETECTOR=target/detector.
set -eu
cd "$(dirname "$0")/.."
. tests/tools.sh
need_compilers
folder=${CARGO_TARGET_DIR:-$PWD/target}/detector
mkdir -p "$folder"
fetch() {
    python3 -m venv "$folder/venv" || { install python3-venv && python3 -m venv "$folder/venv"; } || return 1
    "$folder/venv/bin/pip" install -q 'onnx>=1.16' 'numpy>=1.26' || return 1
    command -v npm || install npm || return 1
    (cd "$folder" && npm pack @vladmandic/human@3.3.6 && tar xzf vladmandic-human-3.3.6.tgz package/models) || return 1
    "$folder/venv/bin/python" tests/harness/detector/centernet_to_onnx.py "$folder/package/models" "$folder/centernet.part" || return 1
    "$folder/venv/bin/pip" download -q --no-deps --only-binary :all: -d "$folder" ultralytics==8.3.0 || return 1
    "$folder/venv/bin/python" -m zipfile -e "$folder"/ultralytics-8.3.0-*.whl "$folder/wheel" || return 1
    cp "$folder/wheel/ultralytics/assets/bus.jpg" "$folder/bus.jpg"
    mv "$folder/centernet.part" "$folder/centernet.onnx"
    rm -rf "$folder"/*.tgz "$folder"/*.whl "$folder/package" "$folder/wheel" "$folder/venv"
}
if [ ! -f "$folder/centernet.onnx" ] && ! fetch >/dev/null 2>&1; then
    skip network "the detector on a real one cannot be fetched here (npm @vladmandic/human, PyPI onnx and ultralytics)"
fi
[ "$only" != --install ] || exit 0
VIEWSHED_DETECTOR=$folder exec cargo test --release --locked --package viewshed-detector
