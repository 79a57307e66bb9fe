#!/usr/bin/env bash
# A cluster on one machine, for tests: the controller and two nodes of a real Slurm on the loopback. Needs root, and Debian's
# slurm-wlm and munge.
#   slurm.sh start DIR     prints the SLURM_CONF to use
#   slurm.sh kill DIR n2   ends a node and all that runs on it, as if its power had failed
#   slurm.sh stop DIR      ends everything
set -euo pipefail
verb=$1 dir=$2

# A node, and what runs on it: processes that have its name in their environment, and the steps above them.
end_node() {
    local process parent
    kill -9 "$(cat "$dir/$1.pid")" 2>/dev/null || true
    for process in $(pgrep -u "$(id -u)" .); do
        { tr '\0' '\n' <"/proc/$process/environ" >"$dir/environ"; } 2>/dev/null || continue
        grep -qx "SLURM_CONF=$dir/slurm.conf" "$dir/environ" && grep -qx "SLURMD_NODENAME=$1" "$dir/environ" || continue
        parent=$(ps -o ppid= -p "$process" | tr -d ' ')
        if grep -q slurmstepd "/proc/$parent/comm" 2>/dev/null; then kill -9 "$parent" 2>/dev/null || true; fi
        kill -9 "$process" 2>/dev/null || true
    done
}

case $verb in
kill)
    end_node "$3"
    # What the controller would find out by itself, after SlurmdTimeout and some more
    SLURM_CONF="$dir/slurm.conf" scontrol update nodename="$3" state=down reason=power
    ;;
stop)
    kill -9 "$(cat "$dir/controller.pid")" 2>/dev/null || true # first, or it starts jobs again
    for node in n1 n2; do end_node $node; done
    kill "$(cat "$dir/munge.pid")" 2>/dev/null || true
    ;;
start)
    mkdir -p "$dir/state"
    # Munge of our own: a key, a socket, a process, all in this folder and as root
    chmod 755 "$dir"
    head -c 1024 /dev/urandom >"$dir/munge.key"
    chmod 400 "$dir/munge.key"
    munged --force --key-file="$dir/munge.key" --socket="$dir/munge.socket" --pid-file="$dir/munge.pid" \
        --log-file="$dir/munge.log" --seed-file="$dir/munge.seed" --num-threads=1 >&2
    host=$(hostname -s)
    cat >"$dir/slurm.conf" <<CONF
ClusterName=noisefloor
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$dir/munge.socket
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/controller.pid
SlurmdPidFile=$dir/%n.pid
SlurmctldLogFile=$dir/controller.log
SlurmdLogFile=$dir/%n.log
SlurmctldPort=16917
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=bf_interval=1,sched_interval=1,sched_min_interval=100000,batch_sched_delay=0
ReturnToService=2
MpiDefault=none
SlurmdTimeout=4
KillWait=1
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=16921 CPUs=1
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=16922 CPUs=1
PartitionName=test Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
CONF
    export SLURM_CONF=$dir/slurm.conf
    slurmctld >&2
    for node in n1 n2; do slurmd -N $node >&2; done
    for _ in $(seq 100); do
        [ "$(sinfo --noheader --states=idle --format=%D 2>/dev/null)" = 2 ] && echo "$SLURM_CONF" && exit
        sleep 0.1
    done
    echo "the nodes are not ready:" >&2
    tail -n 5 "$dir"/*.log >&2
    exit 1
    ;;
esac
