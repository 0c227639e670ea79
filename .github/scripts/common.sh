# Sourced by the scripts of this folder: where things are, and what a release is built with.
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)

# A path as the system's own programs write it.
native() { if command -v cygpath >/dev/null; then cygpath -w "$1"; else echo "$1"; fi; }
fail() { echo "$0: $*" >&2; exit 1; }
digest() { if command -v sha256sum >/dev/null; then sha256sum "$@"; else shasum -a 256 "$@"; fi; }
python() { if command -v python3 >/dev/null; then python3 "$@"; else command python "$@"; fi; }

# Folders of this machine that a compiler writes into a program, in messages of panics, and what stands there instead.
flags=(
  "--remap-path-prefix=$(native "$HOME")=home"
  "--remap-path-prefix=$(native "${CARGO_HOME:-$HOME/.cargo}")=cargo"
  "--remap-path-prefix=$(native "$(rustc --print sysroot)")=rust"
  "--remap-path-prefix=$(native "$PWD")=noctograph"
)
case ${1:-} in *-windows-msvc) flags+=(-C target-feature=+crt-static) ;; esac # no library to install
CARGO_ENCODED_RUSTFLAGS=$(IFS=$'\x1f'; echo "${flags[*]}")
export CARGO_ENCODED_RUSTFLAGS

# Fails where a file names a folder of this machine.
names_nobody() {
  local folder
  for folder in "$HOME/" "$(native "$HOME")\\" "$PWD/" "$(native "$PWD")\\"; do
    ! grep -aqF -- "$folder" "$1" || fail "$1 names the folder $folder"
  done
}

# Puts maturin and zig on the path: zig links for the C library of 2018, glibc 2.28, on any machine.
glibc=2.28
tools() {
  local venv=$PWD/target/release-venv bin
  [ -d "$venv" ] || python -m venv "$venv"
  bin=$venv/bin
  [ -d "$bin" ] || bin=$venv/Scripts
  "$bin/pip" install -q --disable-pip-version-check cargo-zigbuild==0.24.1 maturin==1.16.0 ziglang==0.17.1
  PATH=$bin:$PATH
}
