# Run at every build; the file changes only when the version does. SOURCE, OUTPUT, PROJECT_VERSION.
set(version "${PROJECT_VERSION}")
find_program(git git)
if(git AND EXISTS ${SOURCE}/.git)
  execute_process(COMMAND ${git} -C ${SOURCE} describe --always --dirty=,\ changed --abbrev=7 --match=v[0-9]*
                  OUTPUT_VARIABLE revision ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE result)
  if(result EQUAL 0)
    string(APPEND version " (${revision})")
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT [[#include "platform/version.h"

namespace haustra {

const char* Version() { return "@version@"; }

}  // namespace haustra
]] @ONLY)
