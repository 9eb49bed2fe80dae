#!/bin/sh
# usage: run.sh OUTPUT_FOLDER FOLDER...
# Alignment and scene folders through both evaluators, with their peers (cv::grabCut, eq. 9 as published);
# writes OUTPUT_FOLDER/alignment.md.
set -e
output=$1
shift
mkdir -p "$output"
/usr/bin/python3 "$(dirname "$0")/alignment_report.py" "$output" "$@"
