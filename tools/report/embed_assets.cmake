# Writes OUTPUT, the definitions of page_assets.h, from the files as bytes: raw string literals have a length limit.
function(append_asset name path)
  file(READ ${path} hex HEX)
  string(LENGTH "${hex}" num_digits)
  math(EXPR num_bytes "${num_digits} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  file(APPEND ${OUTPUT}.new
    "const unsigned char ${name}_bytes[] = {\n${bytes}\n};\n"
    "std::string_view ${name}() { return {reinterpret_cast<const char*>(${name}_bytes), ${num_bytes}}; }\n\n")
endfunction()

file(WRITE ${OUTPUT}.new
  "// Made by tools/report/embed_assets.cmake.\n#include \"tools/report/page_assets.h\"\n\nnamespace haustra::report {\n\n")
append_asset(ChartJs ${CHART_JS})
append_asset(ReportJs ${PAGE}/report.js)
append_asset(ReportCss ${PAGE}/report.css)
append_asset(ChartJsLicence ${PAGE}/chart_js_licence.txt)
file(APPEND ${OUTPUT}.new "}  // namespace haustra::report\n")
file(RENAME ${OUTPUT}.new ${OUTPUT})
