#!/bin/bash
# Be the head of a cluster and its edge, as a container does; with a fleet, the provider's service, too.
#
# From the environment:
#   RAY_AUTH_TOKEN_PATH    the cluster's token, mode 0600, of this user
#   AERODAAS_FLEET         the fleet's environment file               (default: no service)
#   AERODAAS_STATE         folder of the service's database           (default: ~/state)
#   AERODAAS_CERTIFICATE   certificate and key of the service; without, it listens on
#   AERODAAS_KEY           loopback only
#   AERODAAS_OWN_ADDRESS   where other nodes find this one            (default: the first address)
#   AERODAAS_OBJECT_STORE  bytes of Ray's object store, within /dev/shm (default: Ray's)
#   AERODAAS_VENV          Python environment with aerodaas           (default: ~/aerodaas)
#   AERODAAS_ROOT          1 lets it run as root                      (default: it does not)
set -euo pipefail

fail() {
    echo "edge-head: $1" >&2
    exit 1
}

venv=${AERODAAS_VENV:-$HOME/aerodaas}
own=${AERODAAS_OWN_ADDRESS:-$(hostname -I | cut -d' ' -f1)}
[ -x "$venv/bin/ray" ] || fail "no Ray in $venv: set AERODAAS_VENV"
[ -n "$own" ] || fail "this machine has no address: set AERODAAS_OWN_ADDRESS"
[ "$(id -u)" != 0 ] || [ "${AERODAAS_ROOT:-}" = 1 ] || fail "runs as root; AERODAAS_ROOT=1 allows it"

# As clusters/onprem.yaml has them, which says why.
export RAY_AUTH_MODE=token RAY_USAGE_STATS_ENABLED=0
export RAY_DEFAULT_PYTHON_VERSION_MATCH_LEVEL=minor RAY_max_direct_call_object_size=4194304
# A new folder: one of a known name may be another user's. Those of former starts are ours to remove.
find /tmp -maxdepth 1 -type d -user "$(id -u)" -name 'ray-control.*' -print0 | xargs -0r rm -rf
control=$(mktemp -d /tmp/ray-control.XXXXXXXX)
export RAY_gcs_storage=rocksdb RAY_gcs_storage_path=$control

"$venv/bin/python" -m aerodaas cluster token >/dev/null || fail "no token"

if [ -n "${AERODAAS_FLEET:-}" ]; then
    set -- "$AERODAAS_FLEET" --state "${AERODAAS_STATE:-$HOME/state}" --address "$own:6379"
    if [ -n "${AERODAAS_CERTIFICATE:-}" ]; then
        set -- "$@" --host 0.0.0.0 --certificate "$AERODAAS_CERTIFICATE" --key "${AERODAAS_KEY:-}"
    fi
    # A service that ends is started again, and finds its flights; Ray and they go on meanwhile.
    while true; do
        sleep 2
        "$venv/bin/python" -m aerodaas serve "$@" || true
    done &
fi

echo "edge-head: $own:6379"
exec "$venv/bin/ray" start --head --block --port=6379 --node-ip-address="$own" \
    ${AERODAAS_OBJECT_STORE:+--object-store-memory="$AERODAAS_OBJECT_STORE"} \
    --dashboard-host=127.0.0.1 --resources='{"edge":1}'
