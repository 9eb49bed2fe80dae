#!/bin/sh
# usage: contact.sh OUTPUT_FOLDER [SCENE_FOLDER...]
# Runs the contact cases, Bullet's own deformable contact among them, and writes OUTPUT_FOLDER/contact.md.
# A case that takes longer than 45 s is stopped, and the page says so.
set -e
output=$1
shift
mkdir -p "$output"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cases="slope slope_soft sliding bounce resting_block hertz soft_soft_momentum soft_rigid_momentum cloth_on_edge stack
  mass_ratio friction_extremes squeezed overlap_at_start two_cubes two_bodies pyramid asleep falling_cubes
  bullet_cube_30 bullet_cube_60 bullet_cube_120 bullet_cube_240 bullet_two_cubes_30 bullet_two_cubes_60
  bullet_two_cubes_120 bullet_two_cubes_240 fast_block_thin_plate"
for case in $cases "$@"; do
  status=0
  timeout 45 rosrun calipso_fem evaluate_contact "$case" >> "$work/contact.jsonl" || status=$?
  [ $status -eq 0 ] || [ $status -eq 124 ] || exit $status
done
for case in $cases "$@"; do
  grep -q "\"case\": \"$case\"" "$work/contact.jsonl" ||
    echo "{\"case\": \"$case\", \"quantity\": \"not finished within 45 s\", \"value\": null, \"reference\": null, \"rel_error\": null, \"max_penetration_ratio\": null, \"energy_growth\": null, \"ms_per_frame\": null}" >> "$work/contact.jsonl"
done
/usr/bin/python3 "$(dirname "$0")/contact_report.py" "$output" "$work/contact.jsonl"
