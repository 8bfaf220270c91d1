#!/usr/bin/env bash
# ansible-test on a copy: it insists on a path that ends in ansible_collections/rosops/fleet. Sanity gets what the package
# holds, which is what Galaxy judges; units what is, or would be, committed, because a package has no tests.
# Usage: [CORE=2.21] tests/ansible_test.sh sanity|units [options]; without CORE by the ansible-core of .venv.
set -euo pipefail
top=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
command=${1:?usage: [CORE=2.21] tests/ansible_test.sh sanity|units [options]}
shift
core=${CORE:-}
# what .venv has needs no other
[ "$core" != "$("$top/.venv/bin/python" -c 'import ansible.release; print(ansible.release.__version__.rpartition(".")[0])')" ] || core=
base=$top/.ansible/test${core:+/core-$core}
# its caches and virtual environments lie under HOME, so HOME lies in the checkout
home=$base/home
copy=$base/ansible_collections/rosops/fleet
if [ -n "$core" ]; then
    # from 2.20 on ansible-core needs a newer Python than the collection
    python=$("$("$top/tests/lab/find_python" 3.12)" "$top/tests/lab/lablib" python "core-$core")
else
    python=$top/.venv/bin/python
fi

mkdir -p "$home" "$copy"
# What ansible-test wrote into a former one goes with it.
find "$copy" -mindepth 1 -delete
if [ "$command" = sanity ]; then
    package=$(mktemp -d)
    trap 'rm -r "$package"' EXIT
    "$top/.venv/bin/ansible-galaxy" collection build --output-path "$package" "$top" > /dev/null
    tar -C "$copy" -xzf "$package"/*.tar.gz
    # Galaxy's own: built into the package, and in no checkout
    rm "$copy/MANIFEST.json" "$copy/FILES.json"
    cp "$top/galaxy.yml" "$copy"
else
    git -c safe.directory="$top" -C "$top" ls-files --cached --others --exclude-standard -z |
        while IFS= read -r -d '' file; do
            # removed in the working tree, but not yet in the index
            if [ -e "$top/$file" ] || [ -L "$top/$file" ]; then printf '%s\0' "$file"; fi
        done | tar -C "$top" --null --no-recursion -T - -c | tar -C "$copy" -x
fi
# what ours imports and documents by; ansible-test looks for it beside the copy alone
ln -sfn "$("$top/.venv/bin/python" -c 'import ansible_collections; print(next(iter(ansible_collections.__path__)))')/kubernetes" \
    "$base/ansible_collections/kubernetes"
# a repository of its own: to the checkout's, whose .gitignore hides it, the copy would be empty
git -c init.defaultBranch=main init --quiet "$copy"

# ansible-test fetches a script that installs pip from a host of its own. The one that it finds in its cache instead
# installs the same pip from the package index, like everything else here.
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
# One Python: a version manager's shims look like others, and fail.
"$python" "$(dirname "$python")/ansible-test" "$command" --local --python "$python_version" --color no "$@"
