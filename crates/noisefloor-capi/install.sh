#!/bin/sh
# Installs header, libraries and the file for pkg-config:
#
#   crates/noisefloor-capi/install.sh PREFIX            builds optimised libraries, and installs them
#   crates/noisefloor-capi/install.sh PREFIX FOLDER     installs the libraries in FOLDER, such as target/debug/deps
set -eu
[ $# -ge 1 ] || { sed -n 's/^# *//p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1/include" "$1/lib/pkgconfig"
prefix=$(cd "$1" && pwd)
if [ $# -ge 2 ]; then
    built=$2
else
    cargo build --release --manifest-path "$here/Cargo.toml"
    built=${CARGO_TARGET_DIR:-$here/../../target}/release
fi
version=$(cargo pkgid --manifest-path "$here/Cargo.toml")
version=${version##*[@#]}

cp "$here/include/noisefloor.h" "$prefix/include/"
cp "$built/libnoisefloor_capi.a" "$prefix/lib/libnoisefloor.a"
case $(uname) in
Darwin)
    cp "$built/libnoisefloor_capi.dylib" "$prefix/lib/libnoisefloor.dylib"
    install_name_tool -id "$prefix/lib/libnoisefloor.dylib" "$prefix/lib/libnoisefloor.dylib"
    private="-liconv -lm" ;;
*)
    # Programs look for the name that build.rs wrote into the library
    cp "$built/libnoisefloor_capi.so" "$prefix/lib/libnoisefloor.so.$version"
    ln -sf "libnoisefloor.so.$version" "$prefix/lib/libnoisefloor.so.0"
    ln -sf "libnoisefloor.so.0" "$prefix/lib/libnoisefloor.so"
    private="-lgcc_s -lutil -lrt -lpthread -lm -ldl" ;;
esac
cat >"$prefix/lib/pkgconfig/noisefloor.pc" <<PC
prefix=$prefix
libdir=\${prefix}/lib
includedir=\${prefix}/include

Name: noisefloor
Description: Tells progressive renderers, tile by tile, when people stop seeing noise
Version: $version
Cflags: -I\${includedir}
Libs: -L\${libdir} -lnoisefloor
Libs.private: $private
PC
echo "installed noisefloor $version in $prefix"
