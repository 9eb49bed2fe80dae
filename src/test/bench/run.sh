#!/bin/sh
# usage: run.sh OUTPUT_FOLDER SCENE_FOLDER...
# Takes every object out of the scenes' videos with the whole graph, judges the pictures and what the graph found of the
# objects, and writes OUTPUT_FOLDER/graph.md.
set -e
output=$1
shift
mkdir -p "$output"
exec /usr/bin/python3 "$(dirname "$0")/graph_report.py" "$output/graph.md" "$@"
