"""Models on this machine: llama.cpp in a child process, the weights that it loads, and the slots that it keeps."""
