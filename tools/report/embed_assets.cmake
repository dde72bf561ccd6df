# Writes OUTPUT, definitions of functions that return the contents of files, in NAMESPACE. HEADER declares them. ASSETS is a
# list of NAME=PATH; a name that stands several times gets its files one after the other. As bytes: raw string literals have a
# length limit.
set(names)
foreach(asset IN LISTS ASSETS)
  string(REGEX MATCH "^([A-Za-z0-9]+)=(.+)$" parts "${asset}")
  list(APPEND names ${CMAKE_MATCH_1})
  list(APPEND files_${CMAKE_MATCH_1} ${CMAKE_MATCH_2})
endforeach()
list(REMOVE_DUPLICATES names)

file(WRITE ${OUTPUT}.new "// Made by tools/report/embed_assets.cmake.\n#include \"${HEADER}\"\n\nnamespace ${NAMESPACE} {\n\n")
foreach(name IN LISTS names)
  set(hex)
  foreach(path IN LISTS files_${name})
    file(READ ${path} part HEX)
    string(APPEND hex "${part}")
  endforeach()
  string(LENGTH "${hex}" num_digits)
  math(EXPR num_bytes "${num_digits} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  file(APPEND ${OUTPUT}.new
    "const unsigned char ${name}_bytes[] = {\n${bytes}\n};\n"
    "std::string_view ${name}() { return {reinterpret_cast<const char*>(${name}_bytes), ${num_bytes}}; }\n\n")
endforeach()
file(APPEND ${OUTPUT}.new "}  // namespace ${NAMESPACE}\n")
file(RENAME ${OUTPUT}.new ${OUTPUT})
