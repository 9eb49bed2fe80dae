#!/bin/sh
# usage: run.sh OUTPUT_FOLDER SCENE_FOLDER...
# Runs the evaluator and its peers on the scenes and on filmed cases, and writes OUTPUT_FOLDER/dynamics.md.
set -e
output=$1
shift
mkdir -p "$output"
program=$(catkin_find --first-only --libexec calipso_flow evaluate)
exec /usr/bin/python3 "$(dirname "$0")/report.py" --evaluate "$program" --out "$output/dynamics.md" "$@"
