"""usage: spread.py RESULT.json...
Median and worst of every object over the recordings of `evaluate --perturb N`: what rests on chance shows here."""
import json
import statistics
import sys

ERRORS = {'velocity %': 'velocity_error_percent', 'spin %': 'angular_velocity_error_percent',
          'g %': 'g_error_percent', 'thrown before': 'thrown_before_px', 'after': 'thrown_after_px'}


def values(runs, key):
    return [run[key] for run in runs if run.get(key) is not None]


def spread(numbers, worst=max):
    return f'{statistics.median(numbers):.3g} ({worst(numbers):.3g})' if numbers else '-'


def impacts(runs):
    """Impacts found in how many runs, e.g. 3x8 2x1, of how many, and false ones in all runs."""
    found = values(runs, 'impacts_found')
    counts = ' '.join(f'{n:.0f}x{found.count(n)}' for n in sorted(set(found), reverse=True))
    return f"{counts} of {runs[0]['impacts_present']:.0f}, {sum(values(runs, 'impacts_false')):.0f} false"


def row(runs):
    cells = [f'{title} {spread(values(runs, key))}' for title, key in ERRORS.items()]
    cells.append(f"covered {spread(values(runs, 'covered_95'), min)}")
    cells.append(f"impacts {impacts(runs)}")
    cells.append(f"cpu {spread(values(runs, 'cpu_ms_frame'))}")
    return '  '.join(cells)


def main():
    objects = {}
    for path in sys.argv[1:]:
        with open(path, encoding='utf-8') as file:
            for run in json.load(file):
                objects.setdefault((run['case'], run['object']), []).append(run)
    for (case, name), runs in objects.items():
        print(f'{case}/{name} x{len(runs)}: {row(runs)}')


if __name__ == '__main__':
    main()
