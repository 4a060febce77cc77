/* interrupt PATTERN COMMAND: runs a command in this console, waits for a file, and presses Ctrl-C. It ends with 0 for exit code 130. */
#include <stdio.h>
#include <windows.h>

int main(int count, char **arguments) {
    STARTUPINFOA start = {.cb = sizeof start};
    PROCESS_INFORMATION process;
    DWORD code;
    if (count != 3) return 2;
    SetConsoleCtrlHandler(NULL, FALSE);
    if (!CreateProcessA(NULL, arguments[2], NULL, NULL, TRUE, 0, NULL, NULL, &start, &process)) {
        fprintf(stderr, "it does not start: %lu\n", GetLastError());
        return 3;
    }
    WIN32_FIND_DATAA found;
    while (FindFirstFileA(arguments[1], &found) == INVALID_HANDLE_VALUE) {
        if (WaitForSingleObject(process.hProcess, 20) == WAIT_OBJECT_0) break;
    }
    SetConsoleCtrlHandler(NULL, TRUE);
    if (!GenerateConsoleCtrlEvent(CTRL_C_EVENT, 0)) fprintf(stderr, "no console: %lu\n", GetLastError());
    WaitForSingleObject(process.hProcess, INFINITE);
    GetExitCodeProcess(process.hProcess, &code);
    printf("exit code %lu.\n", code);
    return code == 130 ? 0 : 4;
}
