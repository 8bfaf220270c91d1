#!/usr/bin/env bash
# The lab as an Ansible inventory. ROSOPS_LAB says which lab (default: demo).
set -euo pipefail
top=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../.." && pwd)
exec "$top/tests/lab/lab" inventory --lab "${ROSOPS_LAB:-demo}" "$@"
