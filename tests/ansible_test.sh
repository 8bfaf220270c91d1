#!/usr/bin/env bash
# ansible-test on a copy of this checkout: it insists on a path that ends in ansible_collections/rosops/fleet, and it
# would take .venv and the lab's state for parts of the collection. Usage: tests/ansible_test.sh sanity|units [options]
set -euo pipefail
top=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
command=${1:?usage: tests/ansible_test.sh sanity|units [options]}
shift
# its caches and virtual environments lie under HOME, so HOME lies in the checkout
home=$top/.ansible/test/home
copy=$top/.ansible/test/ansible_collections/rosops/fleet

mkdir -p "$home" "$copy"
# The copy is made of what is, or would be, committed. What ansible-test wrote into a former one goes with it.
find "$copy" -mindepth 1 -delete
git -c safe.directory="$top" -C "$top" ls-files --cached --others --exclude-standard -z |
    while IFS= read -r -d '' file; do
        # removed in the working tree, but not yet in the index
        if [ -e "$top/$file" ] || [ -L "$top/$file" ]; then printf '%s\0' "$file"; fi
    done | tar -C "$top" --null --no-recursion -T - -c | tar -C "$copy" -x
# what ours imports and documents by; ansible-test looks for it beside the copy alone
ln -sfn "$("$top/.venv/bin/python" -c 'import ansible_collections; print(next(iter(ansible_collections.__path__)))')/kubernetes" \
    "$top/.ansible/test/ansible_collections/kubernetes"
# a repository of its own: to the checkout's, whose .gitignore hides it, the copy would be empty
git -c init.defaultBranch=main init --quiet "$copy"

# ansible-test fetches a script that installs pip from a host of its own. The one that it finds in its cache instead
# installs the same pip from the package index, like everything else here.
python=$top/.venv/bin/python
python_version=$("$python" -c 'import sys; print(f"{sys.version_info[0]}.{sys.version_info[1]}")')
version=$("$python" -c 'import sys, types
from ansible_test._internal.python_requirements import get_venv_packages
print(get_venv_packages(types.SimpleNamespace(version=sys.argv[1]))["pip"])' "$python_version")
mkdir -p "$home/.ansible/test/cache"
cat > "$home/.ansible/test/cache/get_pip_${version//./_}.py" <<SCRIPT
"""Called as get-pip.py is: installs the packages named into the environment that runs this."""
import subprocess
import sys

words = [word for word in sys.argv[1:] if word not in ("--no-setuptools", "--no-wheel")]
sys.exit(subprocess.call([r"""$python""", "-m", "pip", "--python", sys.executable, "install", *words]))
SCRIPT

cd "$copy"
export HOME=$home
# The caller's collections path would show ansible-test a second copy of this collection.
unset ANSIBLE_CONFIG ANSIBLE_HOME ANSIBLE_COLLECTIONS_PATH
# One Python, that of .venv: a version manager's shims look like others, and fail.
exec "$python" "$top/.venv/bin/ansible-test" "$command" --local --python "$python_version" --color no "$@"
