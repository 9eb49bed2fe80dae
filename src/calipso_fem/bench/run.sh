#!/bin/sh
# usage: run.sh OUTPUT_FOLDER [REFERENCE_PATH...]
# Runs the evaluator on the reference cases, if any, and the benchmark, and writes OUTPUT_FOLDER/fem.md.
set -e
output=$1
shift
mkdir -p "$output"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
touch "$work/evaluate.jsonl"
[ $# -eq 0 ] || rosrun calipso_fem evaluate "$@" > "$work/evaluate.jsonl"
rosrun calipso_fem benchmark > "$work/benchmark.jsonl"
/usr/bin/python3 "$(dirname "$0")/report.py" "$output" "$work/evaluate.jsonl" "$work/benchmark.jsonl"
"$(dirname "$0")/contact.sh" "$output"
