#!/bin/sh
# usage: contact.sh OUTPUT_FOLDER [SCENE_FOLDER...]
# Runs the contact cases, Bullet's own deformable contact among them, and writes OUTPUT_FOLDER/contact.md.
set -e
output=$1
shift
mkdir -p "$output"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
rosrun calipso_fem evaluate_contact > "$work/contact.jsonl"
for scene in "$@"; do
  rosrun calipso_fem evaluate_contact "$scene" >> "$work/contact.jsonl"
done
/usr/bin/python3 "$(dirname "$0")/contact_report.py" "$output" "$work/contact.jsonl"
