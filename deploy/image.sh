#!/usr/bin/env bash
# Builds the image of Axle, `axle:latest` or the tag that is given: the program by cargo on this machine, static, and
# the image from that one file. No registry of images is asked, so that it works where none can be reached.
#
#     deploy/image.sh [TAG]
set -euo pipefail
cd "$(dirname "$0")/.."
tag=${1:-axle:latest}
limit_mb=30

fail() {
    echo "image.sh: $*" >&2
    exit 1
}

command -v docker >/dev/null || fail "docker is missing; on Debian: apt-get install docker.io"
docker version --format '{{.Server.Version}}' >/dev/null || fail "the docker daemon does not answer; is it started, and may you use it?"

# Only the last crate is compiled and linked otherwise than by `cargo build --release`; all others are shared.
cargo rustc --release --locked --package axle --bin axle -- -C target-feature=+crt-static
program=${CARGO_TARGET_DIR:-target}/release/axle
# An image without any library cannot run a program that needs one.
if readelf --program-headers "$program" | grep -q INTERP; then
    fail "$program is not static"
fi

# The daemon gets nothing but what is in here.
context=$(mktemp -d)
trap 'rm -rf "$context"' EXIT
mkdir -p "$context/writable/state" "$context/writable/data"
strip -o "$context/axle" "$program"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
revision=$(git describe --always --dirty 2>/dev/null || echo unknown)
docker build --quiet --file deploy/Dockerfile --tag "$tag" \
    --build-arg VERSION="$version" --build-arg REVISION="$revision" "$context" >/dev/null
bytes=$(docker image inspect --format '{{.Size}}' "$tag")
((bytes <= limit_mb * 1000000)) || fail "$tag has $bytes bytes, more than $limit_mb MB"
echo "$tag: $bytes bytes, $version, $revision"
