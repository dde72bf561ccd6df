#!/usr/bin/env python3
"""Writes the papers of a bundle: licences, list of SOUP, SBOM.

    papers.py --prefix DIR --version V [--cuda V] [--sysroot DIR] --libraries FILE...

DIR/licences gets the licence file of every package that the programs in DIR/bin are made of: those whose shared libraries
(FILE..., as they lie on the machine or in the sysroot) are in DIR/lib, and those that are compiled in (soup.json). SOUP.md
lists them with version, licence, purpose and where their known anomalies stand; sbom.spdx.json (SPDX 2.3) says the same to
programs. Names, versions and licences come from the Debian packages. Exit codes: 0; 65 a package or its licence is not to be
found; 64 usage.
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


class PapersError(Exception):
    pass


class PackageDatabase:
    """The packages of this machine, or of a sysroot that toolchains/make_sysroot.sh made."""

    def __init__(self, sysroot):
        self.root = Path(sysroot) if sysroot else Path("/")
        self.query_command = ["dpkg-query"]
        if sysroot:
            self.query_command.append(f"--admindir={self.root / 'var/lib/dpkg'}")

    def query(self, *arguments):
        return subprocess.run(self.query_command + list(arguments), capture_output=True, text=True, check=False).stdout

    def owners(self, files):
        """The package of each file. Packages may name a file with or without the /usr that /lib is a link to."""
        names = {}
        for file in files:
            inside = "/" + str(Path(os.path.realpath(file)).relative_to(os.path.realpath(self.root)))
            names[inside.removeprefix("/usr")] = file
        found = {}
        if names:
            asked = list(names) + ["/usr" + name for name in names]
            for line in self.query("-S", *asked).splitlines():
                package, _, path = line.partition(": ")
                if path.removeprefix("/usr") in names:
                    found[names[path.removeprefix("/usr")]] = package.split(",")[0].split(":")[0]
        for file in files:
            if file not in found:
                raise PapersError(f"{file}: no package has this file; its licence cannot be told")
        return found

    def has(self, package):
        return bool(self.query("-W", package))

    def describe(self, package):
        fields = self.query("-W", "-f", "${Package}\t${Version}\t${source:Package}\t${Homepage}\t${Architecture}\n",
                            package).splitlines()
        if not fields:
            raise PapersError(f"{package}: not installed")
        name, version, source, homepage, architecture = fields[0].split("\t")
        copyright_file = self.root / "usr/share/doc" / name / "copyright"
        if not copyright_file.exists():
            raise PapersError(f"{copyright_file}: the package has no licence file")
        text = copyright_file.read_text(errors="replace")
        return {"package": name, "version": version, "source": source, "homepage": homepage,
                "architecture": architecture, "copyright": text, "licences": licence_names(text)}


def licence_names(copyright_text):
    """Short names from a copyright file in Debian's machine-readable form; of other files those of the texts they cite."""
    if copyright_text.startswith("Format:"):
        # debian/* holds the packaging, which is not in the bundle.
        names = []
        for paragraph in re.split(r"\n\s*\n", copyright_text):
            files = re.search(r"^Files:\s*(.+)", paragraph, re.MULTILINE)
            licence = re.search(r"^License:[ \t]*(\S.*)", paragraph, re.MULTILINE)
            if files and licence and not files.group(1).startswith("debian/"):
                names.append(licence.group(1).strip())
        return sorted(set(names))
    return sorted({f"{name} (cited)" for name in re.findall(r"common-licenses/([\w.+-]*\w)", copyright_text)})


def sha256(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def collect(database, libraries, soup):
    """Packages by name, each with the libraries that come from it."""
    packages = {}
    owners = database.owners(libraries)
    for name in sorted(set(owners.values())):
        packages[name] = database.describe(name) | {"libraries": []}
    for name in set(soup["compiled_in"]) - set(packages):
        # A page's script is the same on all machines, and is not in a sysroot.
        owner = database if database.has(name) else PackageDatabase("")
        packages[name] = owner.describe(name) | {"libraries": []}
    for library in libraries:
        packages[owners[library]]["libraries"].append(os.path.basename(library))
    for package in packages.values():
        package["purpose"] = soup["purposes"].get(package["source"], "needed by another library of this list")
    return [packages[name] for name in sorted(packages)]


def write_licences(folder, packages):
    folder.mkdir(parents=True, exist_ok=True)
    cited = set()
    for package in packages:
        (folder / f"{package['package']}.txt").write_text(package["copyright"])
        cited.update(re.findall(r"/usr/share/common-licenses/([\w.+-]*\w)", package["copyright"]))
    common = folder / "common-licenses"
    common.mkdir(exist_ok=True)
    for name in sorted(cited):
        text = Path("/usr/share/common-licenses") / name
        if text.exists():
            (common / name).write_bytes(text.read_bytes())


def short(licences, limit=4):
    text = ", ".join(licences[:limit])
    return text + (f" and {len(licences) - limit} more" if len(licences) > limit else "") or "see file"


def write_soup(path, packages, version, cuda):
    lines = [
        f"# SOUP of haustra {version}",
        "",
        "Software of unknown provenance (IEC 62304, 8.1.2) that is in this bundle. Licences are named as in the package; the",
        "full text is in the file of the package's name beside this one. Anomalies are listed by the distribution (link)",
        "and at the project's home. Not in the bundle: the C library, the kernel and the GPU driver of the machine.",
        "",
        "| package | version | purpose | in the bundle as | licences | home | known anomalies |",
        "|---|---|---|---|---|---|---|",
    ]
    for package in packages:
        where = ", ".join(package["libraries"]) or "compiled in"
        lines.append(f"| {package['package']} | {package['version']} | {package['purpose']} | {where} | "
                     f"{short(package['licences'])} | {package['homepage']} | "
                     f"https://bugs.debian.org/src:{package['source']} |")
    if cuda:
        lines.append(f"| CUDA runtime | {cuda} | runs the vision device on NVIDIA GPUs | compiled in | NVIDIA CUDA EULA | "
                     "https://developer.nvidia.com/cuda-toolkit | https://docs.nvidia.com/cuda/cuda-toolkit-release-notes |")
    gpl = sorted({p["source"] for p in packages if any(re.match(r"GPL", name) for name in p["licences"])})
    if gpl:
        lines += ["", "Parts of these sources are under the GPL; whoever ships the bundle checks which parts are in the "
                      "libraries, or builds without them: " + ", ".join(gpl) + "."]
    path.write_text("\n".join(lines) + "\n")


def spdx_id(text):
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", text)


def write_sbom(path, prefix, packages, version, cuda):
    programs = sorted((prefix / "bin").iterdir())
    root = {"SPDXID": "SPDXRef-haustra", "name": "haustra", "versionInfo": version, "licenseDeclared": "Apache-2.0",
            "licenseConcluded": "NOASSERTION", "downloadLocation": "NOASSERTION", "copyrightText": "NOASSERTION",
            "filesAnalyzed": False, "primaryPackagePurpose": "APPLICATION"}
    entries, files = [root], []
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", "SPDXRef-haustra")]

    def add_file(name, owner):
        file = {"SPDXID": spdx_id("file-" + name), "fileName": "./" + name, "licenseConcluded": "NOASSERTION",
                "copyrightText": "NOASSERTION",
                "checksums": [{"algorithm": "SHA256", "checksumValue": sha256(prefix / name)}]}
        # The standard wants SHA-1 of every file as well.
        file["checksums"].insert(0, {"algorithm": "SHA1",
                                     "checksumValue": hashlib.sha1((prefix / name).read_bytes()).hexdigest()})
        files.append(file)
        relations.append((owner, "CONTAINS", file["SPDXID"]))

    for program in programs:
        add_file(f"bin/{program.name}", "SPDXRef-haustra")
    for package in packages:
        entry = {"SPDXID": spdx_id("package-" + package["package"]), "name": package["package"],
                 "versionInfo": package["version"], "downloadLocation": "NOASSERTION",
                 "licenseConcluded": "NOASSERTION", "licenseDeclared": "NOASSERTION",
                 "licenseComments": "as the package names them: " + ", ".join(package["licences"]),
                 "copyrightText": "NOASSERTION", "filesAnalyzed": False, "comment": package["purpose"],
                 "supplier": "Organization: Debian",
                 "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                                   "referenceLocator": f"pkg:deb/debian/{package['package']}@{package['version']}"
                                                       f"?arch={package['architecture']}"}]}
        if package["homepage"]:
            entry["homepage"] = package["homepage"]
        entries.append(entry)
        kind = "DYNAMIC_LINK" if package["libraries"] else "STATIC_LINK"
        relations.append(("SPDXRef-haustra", kind, entry["SPDXID"]))
        for library in package["libraries"]:
            add_file(f"lib/{library}", entry["SPDXID"])
    if cuda:
        entries.append({"SPDXID": "SPDXRef-package-cuda-runtime", "name": "CUDA runtime", "versionInfo": cuda,
                        "downloadLocation": "NOASSERTION", "licenseConcluded": "NOASSERTION",
                        "licenseDeclared": "NOASSERTION", "licenseComments": "NVIDIA CUDA EULA",
                        "copyrightText": "NOASSERTION", "filesAnalyzed": False, "supplier": "Organization: NVIDIA"})
        relations.append(("SPDXRef-haustra", "STATIC_LINK", "SPDXRef-package-cuda-runtime"))
    digest = hashlib.sha256("".join(f["checksums"][1]["checksumValue"] for f in files).encode()).hexdigest()
    when = datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", datetime.now().timestamp())), timezone.utc)
    document = {
        "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"haustra-{version}",
        "documentNamespace": f"https://spdx.org/spdxdocs/haustra-{version}-{digest[:32]}",
        "creationInfo": {"created": when.strftime("%Y-%m-%dT%H:%M:%SZ"), "creators": ["Tool: haustra-papers"]},
        "packages": entries, "files": files,
        "relationships": [{"spdxElementId": a, "relationshipType": kind, "relatedSpdxElement": b}
                          for a, kind, b in relations],
    }
    path.write_text(json.dumps(document, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description="Writes the licences, SOUP.md and sbom.spdx.json of a bundle.")
    parser.add_argument("--prefix", type=Path, required=True)
    parser.add_argument("--version", required=True)
    parser.add_argument("--cuda", default="")
    parser.add_argument("--sysroot", default="")
    parser.add_argument("--libraries", nargs="*", default=[])
    try:
        arguments = parser.parse_args()
    except SystemExit as stop:
        return 64 if stop.code else 0
    try:
        database = PackageDatabase(arguments.sysroot)
        packages = collect(database, arguments.libraries, json.loads((FOLDER / "soup.json").read_text()))
        licences = arguments.prefix / "licences"
        write_licences(licences, packages)
        write_soup(licences / "SOUP.md", packages, arguments.version, arguments.cuda)
        write_sbom(licences / "sbom.spdx.json", arguments.prefix, packages, arguments.version, arguments.cuda)
    except PapersError as error:
        print(f"papers.py: {error}", file=sys.stderr)
        return 65
    return 0


if __name__ == "__main__":
    sys.exit(main())
