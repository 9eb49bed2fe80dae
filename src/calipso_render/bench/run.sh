#!/bin/sh
# usage: run.sh OUTPUT_FOLDER SCENE_FOLDER...
# Runs the evaluator and the benchmark with its peers on the scenes, and writes OUTPUT_FOLDER/appearance.md with its pictures.
set -e
output=$1
shift
mkdir -p "$output"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$output/appearance"
# Only what has true masks can be judged; drawing is timed in any case.
for scene in "$@"; do
  shift
  if [ -d "$scene/masks" ] && grep -q true_mesh "$scene/scene.yaml"; then set -- "$@" "$scene"; else echo "$scene has no ground truth: left out"; fi
done
: > "$work/evaluate.jsonl"
: > "$work/enlarged.jsonl"
if [ $# -gt 0 ]; then
  rosrun calipso_render evaluate --summaries "$output/appearance" "$@" > "$work/evaluate.jsonl"
  rosrun calipso_render evaluate --enlarge 2 "$@" > "$work/enlarged.jsonl"
fi
rosrun calipso_render benchmark "$@" > "$work/benchmark.jsonl"
/usr/bin/python3 "$(dirname "$0")/report.py" "$output/appearance.md" "$work/evaluate.jsonl" "$work/enlarged.jsonl" \
  "$work/benchmark.jsonl"
