#!/bin/bash
#SBATCH --job-name=malleus
#SBATCH --signal=B:USR1@300
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%j.out
# A run of forge or inject that outlives its time limits: 300 s before a limit it writes a checkpoint, the job goes back
# to the queue, and the next leg goes on from there, until the run is done.
set -uo pipefail

usage() {
  cat <<'TEXT'
usage: sbatch --ntasks=N --time=HH:MM:SS scripts/slurm/job.sh forge|inject CASE.ini [OPTIONS...]

Runs a case in as many legs as its time limits ask for. What stands after CASE.ini goes to the program (-o DIR, -D ...).
  --signal=B:USR1@S   to sbatch: how long before the limit to stop (default 300 s): a checkpoint and an increment must fit
  MALLEUS_BIN         where the programs are (default: build/bin of the checkout that sbatch was called in)
  MALLEUS_LEGS        most legs, against runs that never get on (default: 100)
Ends with the program's exit code: 85 where it stopped for another reason than the time limit ([limits], a file `stop`),
after the last leg, and where the job could not be put back into the queue.
TEXT
}

case ${1:-} in
  -h | --help) usage; exit 0 ;;
  forge | inject) ;;
  *) usage >&2; exit 2 ;;
esac
[[ $# -ge 2 ]] || { usage >&2; exit 2; }
program=$1
shift
bin=${MALLEUS_BIN:-${SLURM_SUBMIT_DIR:-$PWD}/build/bin}
export OMP_NUM_THREADS=1

# mpirun hands SIGUSR1 on to the ranks; Slurm signals this shell alone, which must not sleep in the foreground meanwhile.
mpirun -n "${SLURM_NTASKS:-1}" "$bin/$program" --restart "$@" &
run=$!
was_signalled=no
trap 'was_signalled=yes; kill -USR1 $run' USR1
wait $run
code=$?
while kill -0 $run 2>/dev/null; do  # wait came back for the signal, not for the end
  wait $run
  code=$?
done

leg=$((${SLURM_RESTART_COUNT:-0} + 1))
# From 128 on: the signal came before the program could listen. Nothing is lost then.
if [[ $was_signalled == yes && ($code -eq 85 || $code -ge 128) && $leg -lt ${MALLEUS_LEGS:-100} ]]; then
  echo "job: leg $leg stopped before the time limit; back to the queue"
  scontrol requeue "$SLURM_JOB_ID" && exit 0
fi
exit $code
