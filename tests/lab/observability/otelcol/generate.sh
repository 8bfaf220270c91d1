#!/usr/bin/env bash
# Makes the Go files, go.mod and go.sum beside it of builder.yaml, with the collector's own builder. Needs `go` (.venv/bin).
set -euo pipefail
here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
version=$(sed -n 's/^  version: //p' "$here/builder.yaml")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
go mod init rosops.example/builder
go get -tool "go.opentelemetry.io/collector/cmd/builder@v$version"
# where it writes to is said in its configuration only
sed "s|^dist:|dist:\n  output_path: $scratch/out|" "$here/builder.yaml" > builder.yaml
go tool builder --config builder.yaml --skip-compilation
rm out/main_windows.go
cp out/* "$here/"
