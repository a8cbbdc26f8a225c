#!/bin/bash
#SBATCH --job-name=malleus-array
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%A_%a.out
# One run for each line of a list, as tasks of a job array; each goes on after its time limits as job.sh does.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: sbatch --array=1-M --ntasks=N --time=HH:MM:SS scripts/slurm/array.sh forge|inject CASE.ini LIST

Task I of the array runs CASE.ini with the options in line I of the file LIST (-D section.key=value ..., shell quoting),
into out/<case name>-I.
TEXT
}

case ${1:-} in
  -h | --help) usage; exit 0 ;;
esac
[[ $# -eq 3 && -n ${SLURM_ARRAY_TASK_ID:-} ]] || { usage >&2; exit 2; }
options=$(sed -n "${SLURM_ARRAY_TASK_ID}p" "$3")
[[ -n $options ]] || { echo "array: $3 has no line $SLURM_ARRAY_TASK_ID" >&2; exit 2; }
eval "words=($options)"
name=$(basename "$2" .ini)-$SLURM_ARRAY_TASK_ID
# Slurm keeps a copy of this script elsewhere: job.sh is looked for where sbatch was called, or where one says.
exec bash "${MALLEUS_SLURM:-${SLURM_SUBMIT_DIR:-$PWD}/scripts/slurm}/job.sh" "$1" "$2" -o "out/$name" "${words[@]}"
