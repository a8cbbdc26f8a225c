/// Libraries stay loaded to the end, so that the leak sanitizer can name them: see leaks.supp. For sanitized builds.

extern "C" int dlclose(void* /*library*/) {
  return 0;
}
