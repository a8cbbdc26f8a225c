#!/bin/bash
#SBATCH --job-name=meshtool
#SBATCH --output=slurm-%j.out
# A command of meshtool in parallel. It writes its file at the end, under its name only when whole: it is simply repeated
# where its time did not do.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: sbatch --ntasks=N --time=HH:MM:SS scripts/slurm/meshtool.sh refine|partition|convert|info ARGUMENTS...

Runs meshtool on N ranks. MALLEUS_BIN: where the programs are (default: build/bin of the checkout that sbatch was called in).
TEXT
}

case ${1:-} in
  -h | --help) usage; exit 0 ;;
  '') usage >&2; exit 2 ;;
esac
export OMP_NUM_THREADS=1
exec mpirun -n "${SLURM_NTASKS:-1}" "${MALLEUS_BIN:-${SLURM_SUBMIT_DIR:-$PWD}/build/bin}/meshtool" "$@"
