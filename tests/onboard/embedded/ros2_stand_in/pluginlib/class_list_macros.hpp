#pragma once
#define PLUGINLIB_EXPORT_CLASS(OWN, BASE) \
  BASE *made() { return new OWN; }
