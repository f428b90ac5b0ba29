#!/bin/sh
# Starts a Slurm of one node on this machine, runs the smoke configuration on it, and stops it again.
#
#     tests/slurm/run.sh [RECORD [REFERENCE]]
#
# RECORD gets the results (CSV). REFERENCE is a project in which the smoke configuration has run without Slurm;
# without it, it is run first. Needed: root, and Debian's packages slurm-wlm and munge. Jobs look for the
# configuration in its usual place, so a machine that has one is left alone.
set -eu
conf=/etc/slurm/slurm.conf
[ ! -e "$conf" ] || { echo "$conf: there already; this machine has a Slurm of its own" >&2; exit 2; }
umask 022
tests=$(cd "$(dirname "$0")/.." && pwd)
slurm=$(mktemp -d /var/tmp/slurm.XXXXXX)
chmod 755 "$slurm"
stop() {
    scancel --user "$(id -un)" || true
    sleep 5
    for pid in "$slurm"/*.pid; do kill "$(cat "$pid")" || true; done
    sleep 5
    rm -rf "$slurm" "$conf"
}
trap stop EXIT

dd if=/dev/urandom of="$slurm/key" bs=1024 count=1 2>/dev/null
chmod 600 "$slurm/key"
munged --force --key-file="$slurm/key" --socket="$slurm/munge.socket" --pid-file="$slurm/munged.pid" \
    --log-file="$slurm/munged.log" --seed-file="$slurm/munged.seed"
mkdir -p "$(dirname "$conf")"
cat >"$conf" <<CONF
ClusterName=trial
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$slurm/munge.socket
CredType=cred/munge
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$slurm/state
SlurmdSpoolDir=$slurm/spool
SlurmctldPidFile=$slurm/slurmctld.pid
SlurmdPidFile=$slurm/slurmd.pid
SlurmctldLogFile=$slurm/slurmctld.log
SlurmdLogFile=$slurm/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobCompType=jobcomp/filetxt
JobCompLoc=$slurm/jobs.txt
MpiDefault=none
SwitchType=switch/none
ReturnToService=2
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=2 RealMemory=2000
PartitionName=trial Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
mkdir "$slurm/state" "$slurm/spool"
slurmctld
slurmd
for _ in $(seq 30); do
    [ "$(sinfo --noheader --format %T 2>&1)" = idle ] && break
    sleep 1
done
python "$tests/slurm/trial.py" --jobs "$slurm/jobs.txt" --record "${1:-slurm.csv}" ${2:+--reference "$2"}
