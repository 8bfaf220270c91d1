# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects of a cluster: read, applied, changed and deleted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

from ...module_utils._host.k3s import without_secrets
from ...module_utils._step.objects import Object, is_in, is_terminating
from ...module_utils._step.words import MANAGER
from .._model.secrets import secrets_in, without
from .applied import HIDDEN, Applied, Fields, applied, foreign_fields, taken_over, without_fields
from .cache import OF_CLUSTER, POLICIES, Ref
from .connection import APPLY, JSON, MERGE, ApiConnection, ApiError, Query, anew

FENCED = ("Deployment",)  # what the keeper writes, too
LISTED_FROM = 3  # so many objects of a kind in a namespace are looked up by one list, fewer one by one
ADMINISTRATORS = (
    "It is the whole cluster's, and not as this version of the collection has it. Run rosops.fleet.awx_access and then "
    "rosops.fleet.site with an administrator's access (SSH to the servers), and then this again."
)
OURS_ALONE = ("DaemonSet", "Deployment", "Service", *POLICIES)  # kinds whose whole spec is ours


class Kube(ApiConnection):
    """One cluster."""

    # --- reading ----------------------------------------------------------------------------------------------------

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Object]:
        """All objects of a kind, in one namespace or everywhere."""
        query = {"labelSelector": labels, "fieldSelector": fields}
        path, said = Ref(kind, "", namespace).path, {key: value for key, value in query.items() if value}
        return self._patiently(lambda: self.page(path, said))[0]

    def get(self, ref: Ref) -> Object | None:
        """One object as it is, None if it is not there."""
        try:
            return self._object("GET", ref.path, {})
        except ApiError as exc:
            if exc.status == 404:
                return None
            raise

    def log_tail(self, namespace: str, pod: str, container: str, lines: int = 5, previous: bool = True) -> str:
        """The last lines of a container's log, for a message: without what looks like a secret. Tried once."""
        query: Query = {"container": container, "tailLines": lines, "previous": str(previous).lower()}
        path = f"{Ref('Pod', pod, namespace).path}/log"
        text = self._read("GET", path, query).decode("utf-8", "replace").strip()
        return without_secrets(text)

    # --- writing ----------------------------------------------------------------------------------------------------

    def apply(self, objects: Iterable[Object], dry_run: bool = False) -> list[Applied]:
        """Server-side apply of full definitions, in their order; the inventory is the truth, so conflicts are won.

        A field that an earlier definition had and this one has not goes: so does a label of a node that is taken out of
        the inventory. Fields that others own and the definition does not name are kept, but in the spec of the kinds
        OURS_ALONE: what others put into it goes. What is the whole cluster's (OF_CLUSTER) is written where it is not as
        it should be: an account that may only read it goes on where it is.

        With `dry_run` the API server says what it would do. It cannot do so in a namespace that is not there: what
        belongs there would be new. An error names in its details, as `applied`, what was written before it.
        """
        wanted = [(ref_of(obj), obj) for obj in objects]
        present = self._present([ref for ref, _obj in wanted])
        done: list[Applied] = []
        for ref, obj in wanted:
            try:
                fenced = ref.kind in FENCED and not dry_run
                before = present[ref] if ref in present and not fenced else self.get(ref)
                stays = ref.kind in OF_CLUSTER and before and _is_as_wanted(before, obj)
                done.append(applied(ref, before, before if stays else self._applied(ref, obj, before, dry_run)))
            except ApiError as exc:
                if dry_run and exc.status == 404 and ref.namespace and not self.get(Ref("Namespace", ref.namespace)):
                    done.append(applied(ref, None, obj))
                    continue
                if exc.status == 403 and ref.kind in OF_CLUSTER:
                    exc.args = (f"{exc} {ADMINISTRATORS}",)
                exc.details["applied"] = [str(one.ref) for one in done if one.changed]
                # Kubernetes repeats a value that it does not accept
                exc.args = (without(str(exc), dict.fromkeys(secrets_in(obj), HIDDEN)),)
                raise
        return done

    def _applied(self, ref: Ref, wanted: Object, there: Object | None, dry_run: bool) -> Object:
        """What has become of the object that is `there`, or of what it is by then where somebody has written it since.

        Of a kind of FENCED only what was looked at is written. A request that hangs in the API server while this run
        loses its Lease is refused when it gets through: whoever has the Lease by then has written the object.
        """
        query, known = {"fieldManager": MANAGER, "force": "true", **({"dryRun": "All"} if dry_run else {})}, [there]

        def write() -> Object:
            seen = known.pop() if known else self.get(ref)
            foreign = foreign_fields(seen, wanted, MANAGER) if seen and ref.kind in OURS_ALONE else {}
            if seen and foreign and not dry_run:
                seen = self._take_over(ref, seen, foreign)
            metadata = {**wanted["metadata"]}
            if seen and ref.kind in FENCED and not dry_run:
                metadata["resourceVersion"] = seen["metadata"].get("resourceVersion")
            after = self._object("PATCH", ref.path, query, {**wanted, "metadata": metadata}, APPLY)
            # which a dry run cannot foresee
            return without_fields(after, foreign_fields(after, wanted, MANAGER)) if foreign and dry_run else after

        return anew(write)  # of two robots that create the same object at once, one is told 409, too

    def _take_over(self, ref: Ref, there: Object, foreign: Fields) -> Object:
        """Make what others put into the object ours, so that it goes when we do not apply it."""
        taken = taken_over({"apiVersion": ref.api_version, **there}, foreign, MANAGER)
        part = {"metadata": {"managedFields": taken, "resourceVersion": there["metadata"]["resourceVersion"]}}
        return self._object("PATCH", ref.path, {"fieldManager": MANAGER}, part, MERGE)

    def delete(self, refs: Iterable[Ref], dry_run: bool = False, at_once: bool = False) -> list[Applied]:
        """Delete these, what they own in the background; what is not there is fine.

        Where a uid is said only just that object is deleted: another one of its name stays as it is. `at_once`: pods,
        too, whatever becomes of their containers.
        """
        done: list[Applied] = []
        # all in the body: where there is one, the API server reads no options from the query, dryRun neither
        options: Object = {"kind": "DeleteOptions", "apiVersion": "v1", "propagationPolicy": "Background"}
        options |= {"dryRun": ["All"]} if dry_run else {}
        options |= {"gracePeriodSeconds": 0} if at_once else {}
        for ref in refs:
            before, after = self.get(ref), None
            if before is not None and is_terminating(before) and not at_once:
                after = before  # a finalizer holds it: to ask again does nothing
            elif before is not None:
                body = {**options, **({"preconditions": {"uid": ref.uid}} if ref.uid else {})}
                try:
                    self._object("DELETE", ref.path, {}, body, JSON)
                except ApiError as exc:
                    if exc.status == 409 and ref.uid:
                        after = before
                    elif exc.status != 404:
                        raise
            done.append(applied(ref, before, after))
        return done

    def merge(self, ref: Ref, part: Object, dry_run: bool = False) -> Applied:
        """Merge a part into an object that is there (null removes a key, lists are replaced as a whole).

        A resourceVersion in it makes the API refuse, with status 409, what was worked out from an older object.
        """
        before = self.get(ref)
        query = {"fieldManager": MANAGER, **({"dryRun": "All"} if dry_run else {})}
        return applied(ref, before, self._object("PATCH", ref.path, query, part, MERGE))

    def create(self, obj: Object) -> Object:
        """A new object; status 409 if there is one of its name."""
        ref = ref_of(obj)
        return self._object("POST", replace(ref, name="").path, {}, obj, JSON)

    def token(self, account: Ref, seconds: int) -> str:
        """Of a ServiceAccount; it ends by itself."""
        how = {"apiVersion": "authentication.k8s.io/v1", "kind": "TokenRequest"}
        body = {**how, "spec": {"expirationSeconds": seconds}}
        return str(self._object("POST", f"{account.path}/token", {}, body, JSON)["status"]["token"])

    def replace(self, obj: Object) -> Object:
        """The whole object anew; status 409 if it is not of the resourceVersion that `obj` has."""
        return self._object("PUT", ref_of(obj).path, {}, obj, JSON)

    def _present(self, refs: Sequence[Ref]) -> dict[Ref, Object | None]:
        """The objects as they are, where one list is cheaper than a look at each."""
        alike = Counter((ref.kind, ref.namespace) for ref in refs if ref.namespace)
        found: dict[Ref, Object | None] = {}
        for (kind, namespace), count in alike.items():
            if count >= LISTED_FROM:
                items = {item["metadata"]["name"]: item for item in self.objects(kind, namespace)}
                for ref in (one for one in refs if (one.kind, one.namespace) == (kind, namespace)):
                    item = items.get(ref.name)  # a list's items do not say what they are
                    found[ref] = item and {"apiVersion": ref.api_version, "kind": kind, **item}
        return found


def ref_of(obj: Object) -> Ref:
    """Which object a full definition is of."""
    space, uid = (str(obj["metadata"].get(key) or "") for key in ("namespace", "uid"))
    return Ref(obj["kind"], obj["metadata"]["name"], space, obj["apiVersion"], uid)


def _is_as_wanted(there: Object, wanted: Object) -> bool:
    """With nobody beside its subjects, of which the API server keeps no owners, and nothing beside its spec."""
    alone = len(there.get("subjects") or ()) == len(wanted.get("subjects") or ())
    return alone and is_in(wanted, there) and not foreign_fields(there, wanted, MANAGER)
