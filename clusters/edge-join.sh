#!/bin/bash
# Join an edge node (a Jetson, a ground station, any Linux box) to a cluster, and stay.
#
#   edge-join.sh HEAD:PORT [own address]
#
# HEAD is an address that this machine reaches, and the own address one by which the cluster
# reaches this machine; behind NAT both are addresses of a VPN (docs/cluster.md). Without the
# second, it is the address of the interface that leads to the head.
#
# From the environment, or /etc/aerodaas/edge.env under aerodaas-edge.service:
#   AERODAAS_VENV        Python environment with aerodaas   (default: ~/aerodaas)
#   AERODAAS_RESOURCES   what this node offers              (default: {"edge":1})
#   AERODAAS_OBJECT_STORE  bytes of Ray's object store      (default: Ray's, a third of the memory)
#   RAY_AUTH_TOKEN_PATH  the cluster's token, mode 0600     (default: ~/.ray/auth_token)
#   RAY_USE_TLS and the paths of certificates (docs/cluster.md), if the cluster speaks TLS
set -euo pipefail

fail() {
    echo "edge-join: $1" >&2
    exit 1
}

head=${1:-${AERODAAS_HEAD:-}}
own=${2:-${AERODAAS_OWN_ADDRESS:-}}
venv=${AERODAAS_VENV:-$HOME/aerodaas}
resources=${AERODAAS_RESOURCES:-'{"edge":1}'}

[ -n "$head" ] || fail "say whom to join: edge-join.sh HEAD:6379"
case $head in *:*) ;; *) head=$head:6379 ;; esac
[ -x "$venv/bin/python" ] || fail "no Python in $venv: set AERODAAS_VENV, or python3 -m venv $venv && $venv/bin/pip install aerodaas"

# A second node on one machine would be given work that this machine cannot do twice.
if pgrep -x raylet >/dev/null 2>&1; then
    fail "a Ray node runs on this machine already: \`$venv/bin/ray stop\` ends it"
fi

# Ray gives a head up that is silent for a minute, and ends this node with the drone's actor on
# it. A day lets the drone come home by its own rules first; the processes of its run end by
# themselves once it has landed.
export RAY_gcs_rpc_server_reconnect_timeout_s="${RAY_gcs_rpc_server_reconnect_timeout_s:-86400}"
export RAY_DEFAULT_PYTHON_VERSION_MATCH_LEVEL=minor
# A frame goes to the cloud in the call that it is for, instead of by a reference.
export RAY_max_direct_call_object_size=4194304
# No other mode but by AERODAAS_UNAUTHENTICATED=1, of which the greeting below warns.
export RAY_AUTH_MODE=token
[ "${AERODAAS_UNAUTHENTICATED:-}" != 1 ] || export RAY_AUTH_MODE=disabled
export RAY_USAGE_STATS_ENABLED=0

# Says in one line what Ray would say in a screenful: no answer, wrong token, other versions.
"$venv/bin/python" -m aerodaas cluster greet "$head" || exit 1

if [ -z "$own" ]; then
    # `ip` takes no names, by which containers know each other.
    there=$(getent ahosts "${head%:*}" | sed -n '1s/ .*//p' || true)
    own=$(ip -o route get "${there:-${head%:*}}" | sed -n 's/.* src \([^ ]*\).*/\1/p' || true)
fi
[ -n "$own" ] || fail "no way leads to $head; say this machine's own address after it"
echo "edge-join: joining $head as $own with $resources"
exec "$venv/bin/ray" start --block --address "$head" --node-ip-address "$own" \
    ${AERODAAS_OBJECT_STORE:+--object-store-memory "$AERODAAS_OBJECT_STORE"} \
    --resources "$resources"
