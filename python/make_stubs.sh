#!/usr/bin/env bash
# Makes src/murmuration/_contract from proto/. Stubs of grpcio-tools 1.62 import under protobuf 4 to 7; those of newer ones do not.
#
#   python/make_stubs.sh PYTHON        a Python that has grpcio-tools 1.62.3
set -euo pipefail
cd "$(dirname "$0")"
python=$1
output=${2:-src/murmuration/_contract}
version=$("$python" -c 'import importlib.metadata as m; print(m.version("grpcio-tools"))')
if test "$version" != 1.62.3; then
    echo "grpcio-tools is $version; must be 1.62.3" >&2
    exit 1
fi
mkdir -p "$output"
"$python" -m grpc_tools.protoc -I../proto --python_out="$output" --pyi_out="$output" --grpc_python_out="$output" ../proto/cosim/v1/*.proto
mv "$output"/cosim/v1/*.py "$output"/cosim/v1/*.pyi "$output"
rm -r "$output/cosim"
sed -i 's/^from cosim\.v1 import/from murmuration._contract import/' "$output"/*.py "$output"/*.pyi
printf '"""Messages and services of the contract: made from proto/cosim/v1 by make_stubs.sh."""\n' >"$output/__init__.py"
