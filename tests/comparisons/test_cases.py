"""Every check of every case, through both codes: see comparisons/cases/ for what each one is."""


def test_case(case_check):
    case_check()
