#!/bin/bash
# Make what Ray's TLS asks for: an authority, and for each node a certificate that it signs.
#
#   certificates.sh FOLDER ADDRESS...
#
# FOLDER gets ca.key and ca.crt, if they are not there yet, and for each ADDRESS, by which the other
# nodes know it, ADDRESS.key and ADDRESS.crt. Copy a node's two files and ca.crt to it, to
# /etc/aerodaas/node.key, node.crt and ca.crt (docs/cluster.md). ca.key stays here: whoever has it
# can make a node of the cluster. Applications use the certificate of the node they run on.
#
# From the environment:
#   AERODAAS_DAYS   days for which the certificates hold   (default: 365)
set -euo pipefail

[ $# -ge 2 ] || { echo "usage: certificates.sh FOLDER ADDRESS..." >&2; exit 2; }
folder=$1
shift
days=${AERODAAS_DAYS:-365}
umask 077
mkdir -p "$folder"
# Who may write there, or has made the key, can make nodes of this cluster.
for own in "$folder" "$folder/ca.key"; do
    [ ! -e "$own" ] || [ -O "$own" ] || { echo "certificates: $own is another user's" >&2; exit 1; }
done

new_key() {
    openssl genpkey -quiet -algorithm EC -pkeyopt ec_paramgen_curve:P-256 -out "$1"
}

if [ ! -f "$folder/ca.key" ]; then
    new_key "$folder/ca.key"
    openssl req -x509 -new -key "$folder/ca.key" -days "$days" -subj "/CN=AeroDaaS cluster" \
        -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign" \
        -out "$folder/ca.crt"
fi

for address in "$@"; do
    case $address in
    *[!0-9.]*) case $address in *:*) name=IP:$address ;; *) name=DNS:$address ;; esac ;;
    *) name=IP:$address ;;
    esac
    new_key "$folder/$address.key"
    # Ray's processes on one node also call each other by its loopback address.
    cat >"$folder/extensions" <<EOF
subjectAltName=$name,IP:127.0.0.1,IP:::1,DNS:localhost
extendedKeyUsage=serverAuth,clientAuth
EOF
    openssl req -new -key "$folder/$address.key" -subj "/CN=$address" |
        openssl x509 -req -CA "$folder/ca.crt" -CAkey "$folder/ca.key" -CAcreateserial \
            -days "$days" -extfile "$folder/extensions" -out "$folder/$address.crt"
    rm "$folder/extensions"
done
